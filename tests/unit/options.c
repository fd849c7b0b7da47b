/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Options: who wins, what is refused and in which words, help and example from the table.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/options.h"
#include "tests/unit/cmocka_setup.h"

static const struct gn_option table[] = {
    {.key = "config", .value_name = "FILE", .help = "The configuration file."},
    {.key = "verbose", .type = GN_OPTION_BOOL, .default_value = "no", .help = "Says more."},
    {.section = "server",
     .key = "listen",
     .flag = "listen",
     .type = GN_OPTION_ADDRESS,
     .default_value = "127.0.0.1:7340",
     .help = "Where clients connect."},
    {.section = "server",
     .key = "max-sessions",
     .type = GN_OPTION_INT,
     .min = 1,
     .max = 64,
     .default_value = "8",
     .help = "Sessions at one time."},
    {.section = "server", .key = "token", .is_secret = true, .help = "What clients must know."},
    {.section = "http",
     .key = "listen",
     .flag = "http",
     .type = GN_OPTION_ADDRESS,
     .help = "Where the status page is."},
    {.section = "http",
     .key = "memory",
     .type = GN_OPTION_BYTES,
     .min = 1024,
     .max = 1 << 30,
     .default_value = "64MiB",
     .help = "Memory for pages."},
    {.section = "room *",
     .key = "scene",
     .is_required = true,
     .value_name = "FILE",
     .help = "The scene.json of the room."},
    {.section = "room *",
     .key = "quality",
     .type = GN_OPTION_ENUM,
     .choices = "reference|interactive|seed",
     .default_value = "interactive",
     .help = "How much time a frame may take, in words that are long enough to need a second line "
             "in the help text."},
    {.section = "room *",
     .key = "gain",
     .type = GN_OPTION_DOUBLE,
     .min = 0.1,
     .max = 10,
     .help = "Factor."},
    {.section = "room *",
     .key = "layers",
     .type = GN_OPTION_SET,
     .choices = "shadow|added|depth",
     .help = "Layers."},
};
static const struct gn_program program = {
    .name = "gnomond",
    .usage = "--config FILE [OPTION]... [WORD]",
    .summary = "Serves.",
    .options = table,
    .n_options = sizeof(table) / sizeof(table[0]),
    .max_arguments = 1,
};

static struct gn_options *create(void)
{
    struct gn_options *options = NULL;
    assert_int_equal(gn_options_create(&program, &options), 0);
    return options;
}

static void test_defaults(void **unused)
{
    (void)unused;
    struct gn_options *o = create();
    assert_string_equal(gn_options_get_string(o, "server", NULL, "listen"), "127.0.0.1:7340");
    assert_int_equal(gn_options_get_address(o, "server", NULL, "listen").port, 7340);
    assert_int_equal(gn_options_get_int(o, "server", NULL, "max-sessions"), 8);
    assert_int_equal(gn_options_get_bytes(o, "http", NULL, "memory"), 64 << 20);
    assert_false(gn_options_get_bool(o, NULL, NULL, "verbose"));
    assert_false(gn_options_is_set(o, "http", NULL, "listen"));
    assert_true(gn_options_is_default(o, "http", NULL, "listen"));
    assert_true(gn_options_is_default(o, "server", NULL, "max-sessions"));
    assert_null(gn_options_get_string(o, NULL, NULL, "config"));
    assert_string_equal(gn_options_get_source(o, "server", NULL, "listen"), "default");
    assert_int_equal(gn_options_get_name_count(o, "room"), 0);
    gn_options_destroy(&o);
    assert_null(o);
    gn_options_destroy(&o);
}

/* File < environment < command line, in whatever order they are read. */
static void test_precedence(void **unused)
{
    (void)unused;
    char *const argv[] = {
        "gnomond", "--server-max-sessions=4", "--room.demo.gain", "2.5", "--verbose", "word"};
    char *const environment[] = {"PATH=/bin", "GNOMON_SERVER_MAX_SESSIONS=3", "GNOMON_DATA=/d",
                                 "GNOMON_HTTP_LISTEN=[::1]:80", NULL};
    const char *ini = "\xef\xbb\xbf# all of it\n"
                      "[server]\r\n"
                      "  max-sessions = 2 ; a remark\n"
                      "\tlisten : localhost:0\n"
                      "[http]\n"
                      "listen = 1.2.3.4:5\n"
                      "memory=512KiB\n"
                      "[room demo]\n"
                      "scene = a dir/scene.json\n"
                      "gain = 1e0\n"
                      "[room other]\n"
                      "scene=b.json\nquality = seed"; // no newline at the end
    for (int order = 0; order < 6; order++) {
        static const int orders[6][3] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2},
                                         {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};
        struct gn_options *o = create();
        struct gn_error e = {0};
        for (int i = 0; i < 3; i++) {
            int step = orders[order][i];
            int ret = step == 0   ? gn_options_read_text(o, ini, "g.ini", &e)
                      : step == 1 ? gn_options_read_environment(o, environment, &e)
                                  : gn_options_read_arguments(o, 6, argv, &e);
            assert_string_equal(e.text, "");
            assert_int_equal(ret, 0);
        }
        assert_int_equal(gn_options_check(o, &e), 0);
        assert_int_equal(gn_options_get_int(o, "server", NULL, "max-sessions"), 4);
        assert_string_equal(gn_options_get_source(o, "server", NULL, "max-sessions"),
                            "command line");
        assert_string_equal(gn_options_get_address(o, "http", NULL, "listen").host, "::1");
        assert_string_equal(gn_options_get_source(o, "http", NULL, "listen"), "environment");
        assert_string_equal(gn_options_get_source(o, "server", NULL, "listen"), "g.ini:4");
        assert_int_equal(gn_options_get_bytes(o, "http", NULL, "memory"), 512 << 10);
        assert_int_equal(gn_options_get_name_count(o, "room"), 2);
        assert_string_equal(gn_options_get_string(o, "room", "demo", "scene"), "a dir/scene.json");
        assert_true(gn_options_get_double(o, "room", "demo", "gain") == 2.5);
        assert_false(gn_options_is_default(o, "room", "demo", "gain"));
        assert_int_equal(gn_options_get_enum(o, "room", "demo", "quality"), 1);
        assert_int_equal(gn_options_get_enum(o, "room", "other", "quality"), 2);
        assert_false(gn_options_is_set(o, "room", "other", "gain"));
        assert_true(gn_options_get_bool(o, NULL, NULL, "verbose"));
        assert_int_equal(gn_options_get_argument_count(o), 1);
        assert_string_equal(gn_options_get_argument(o, 0), "word");
        gn_options_destroy(&o);
    }
}

static void expect_ini(const char *ini, const char *sentence)
{
    struct gn_options *o = create();
    struct gn_error e = {0};
    int ret = gn_options_read_text(o, ini, "g.ini", &e);
    if (ret == 0)
        ret = gn_options_check(o, &e);
    assert_string_equal(e.text, sentence);
    assert_int_equal(ret, -EINVAL);
    gn_options_destroy(&o);
}

static void test_ini_errors(void **unused)
{
    (void)unused;
    static const char *const cases[][2] = {
        {"[servr]\n", "g.ini:1: unknown section [servr]; did you mean [server]?"},
        {"\n[zzz]\n", "g.ini:2: unknown section [zzz]; known are [server], [http], [room NAME]"},
        {"[server]\nmax-session = 3\n",
         "g.ini:2: unknown key 'max-session' in [server]; did you mean 'max-sessions'?"},
        {"[http]\nzzz = 3\n", "g.ini:2: unknown key 'zzz' in [http]; known are listen, memory"},
        {"[server]\nmax-sessions = 65\n", "g.ini:2: max-sessions in [server]: expected a whole "
                                          "number in [1, 64], found '65'"},
        {"[server]\nmax-sessions = 3.5\n", "g.ini:2: max-sessions in [server]: expected a whole "
                                           "number in [1, 64], found '3.5'"},
        {"[server]\nmax-sessions = 99999999999\n",
         "g.ini:2: max-sessions in [server]: expected a whole number in [1, 64], found "
         "'99999999999'"},
        {"[server]\nmax-sessions =\n", "g.ini:2: max-sessions in [server]: expected a whole number "
                                       "in [1, 64], found ''"},
        {"[server]\n\n\nmax-sessions = 3\n#\nmax-sessions = 3\n",
         "g.ini:6: max-sessions in [server] is already set in line 4"},
        {"[server]\nlisten = host\n",
         "g.ini:2: listen in [server]: expected HOST:PORT or [IPV6]:PORT, as 127.0.0.1:7340, found "
         "'host'"},
        {"[http]\nmemory = 2GiB\n",
         "g.ini:2: memory in [http]: expected bytes in [1KiB, 1GiB], as 1048576, 512KiB, 64MiB or "
         "2GiB, found '2GiB'"},
        {"[http]\nmemory = 10 MB\n",
         "g.ini:2: memory in [http]: expected bytes in [1KiB, 1GiB], as 1048576, 512KiB, 64MiB or "
         "2GiB, found '10 MB'"},
        {"[room a]\nscene = s\nquality = interactve\n",
         "g.ini:3: quality in [room a]: expected one of reference, interactive, seed, found "
         "'interactve'; did you mean 'interactive'?"},
        {"[room a]\nscene = s\ngain = nan\n",
         "g.ini:3: gain in [room a]: expected a number in [0.1, 10], found 'nan'"},
        {"[room a]\nscene = s\ngain = 0x1\n",
         "g.ini:3: gain in [room a]: expected a number in [0.1, 10], found '0x1'"},
        {"[room a]\nscene =\n", "g.ini:2: scene in [room a]: expected FILE, found ''"},
        {"[room a]\n", "configuration: 'scene' of [room a] (or --room.a.scene) is missing, "
                       "expected FILE"},
        {"[room]\n", "g.ini:1: '' is no name for a room: expected 1 to 32 letters, digits, '-' or "
                     "'_'"},
        {"[room a/b]\n", "g.ini:1: 'a/b' is no name for a room: expected 1 to 32 letters, digits, "
                         "'-' or '_'"},
        {"[server a]\n", "g.ini:1: [server a] takes no name, expected [server]"},
        {"max-sessions = 3\n",
         "g.ini:1: 'max-sessions' stands before any section, expected a [section] first"},
        {"[server\n", "g.ini:1: the section lacks its ']'"},
        {"[server] max-sessions = 1\n",
         "g.ini:1: text after the section's ']', expected a new line"},
        {"[server]\nnonsense\n",
         "g.ini:2: expected 'key = value', '[section]' or a comment, found 'nonsense'"},
        {"[server]\nmax-sessions = 1\n  2\n",
         "g.ini:3: expected 'key = value', '[section]' or a comment, found '2'"},
        {"[server]\nmax-sessions = \x1b[2J\n",
         "g.ini:2: max-sessions in [server]: expected a whole "
         "number in [1, 64], found '?[2J'"},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++)
        expect_ini(cases[i][0], cases[i][1]);
}

static void test_long_lines(void **unused)
{
    (void)unused;
    struct gn_options *o = create();
    struct gn_error e = {0};
    char ini[512];
    int n = snprintf(ini, sizeof(ini), "[room a]\nscene = %0182d\n", 7);
    assert_int_equal(n, 9 + 190 + 1);
    assert_int_equal(gn_options_read_text(o, ini, "g.ini", &e), 0);
    assert_int_equal(strlen(gn_options_get_string(o, "room", "a", "scene")), 182);
    gn_options_destroy(&o);
    snprintf(ini, sizeof(ini), "[room a]\nscene = %0183d\n", 7);
    expect_ini(ini, "g.ini:2: the line has 191 bytes, 190 are allowed");
    snprintf(ini, sizeof(ini), "[room %060d]\n", 7);
    expect_ini(ini, "g.ini:1: the section's name has more than 48 bytes");
    char many[2048] = "";
    for (int i = 0; i < 65; i++)
        snprintf(many + strlen(many), 32, "[room r%d]\nscene=s\n", i);
    o = create();
    assert_int_equal(gn_options_read_text(o, many, "g.ini", &e), -ENOSPC);
    assert_string_equal(e.text, "g.ini:129: more than 64 sections [room *]");
    gn_options_destroy(&o);
}

static void test_files(void **unused)
{
    (void)unused;
    char path[] = "/tmp/gn-options-XXXXXX";
    int fd = mkstemp(path);
    assert_true(fd >= 0);
    assert_int_equal(write(fd, "[server]\n\0max-sessions = 1\n", 27), 27);
    struct gn_options *o = create();
    struct gn_error e = {0};
    assert_int_equal(gn_options_read_file(o, path, &e), -EINVAL);
    assert_non_null(strstr(e.text, "NUL byte"));
    assert_int_equal(ftruncate(fd, (1 << 20) + 1), 0);
    assert_int_equal(gn_options_read_file(o, path, &e), -EFBIG);
    close(fd);
    unlink(path);
    assert_int_equal(gn_options_read_file(o, path, &e), -ENOENT);
    assert_non_null(strstr(e.text, "cannot open"));
    assert_true(gn_options_read_file(o, "/tmp", &e) < 0);
    gn_options_destroy(&o);

    char *const argv[] = {"gnomond", "--config", path, "--room.a.scene", "s"};
    o = (struct gn_options *)path;
    assert_int_equal(gn_options_load(&program, 5, argv, &o, &e), -ENOENT);
    assert_null(o);
}

static void test_environment_errors(void **unused)
{
    (void)unused;
    static const char *const cases[][2] = {
        {"GNOMON_SERVER_LISTN=a:1",
         "environment: unknown variable 'GNOMON_SERVER_LISTN'; did you mean "
         "'GNOMON_SERVER_LISTEN'?"},
        {"GNOMON_X=1", "environment: unknown variable 'GNOMON_X', expected GNOMON_SECTION_KEY"},
        {"GNOMON_SERVER_MAX_SESSIONS=0",
         "environment: GNOMON_SERVER_MAX_SESSIONS: expected a whole "
         "number in [1, 64], found '0'"},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        char variable[64];
        char *const environment[] = {variable, NULL};
        struct gn_options *o = create();
        struct gn_error e = {0};
        strcpy(variable, cases[i][0]);
        assert_int_equal(gn_options_read_environment(o, environment, &e), -EINVAL);
        assert_string_equal(e.text, cases[i][1]);
        gn_options_destroy(&o);
    }
}

/* Clients run beside a daemon whose variables are exported. */
static void test_environment_of_others(void **unused)
{
    (void)unused;
    static const struct gn_option flags[] = {{.key = "server", .help = "Where."},
                                             {.section = "room *", .key = "a", .help = "A."}};
    static const struct gn_program client = {.name = "p", .options = flags, .n_options = 2};
    char *const environment[] = {"GNOMON_HTTP_LISTEN=a:1", "GNOMON_NONSENSE=1", NULL};
    struct gn_options *o = NULL;
    struct gn_error e = {0};
    assert_int_equal(gn_options_create(&client, &o), 0);
    assert_int_equal(gn_options_read_environment(o, environment, &e), 0);
    assert_string_equal(e.text, "");
    gn_options_destroy(&o);
}

static void test_argument_errors(void **unused)
{
    (void)unused;
    static char *const cases[][5] = {
        {"command line: unknown option '--lisen'; did you mean '--listen'?", "--lisen", "x"},
        {"command line: unknown option '--zzz'; see gnomond --help", "--zzz=3"},
        {"command line: unknown option '-v'; options begin with '--', see gnomond --help", "-v"},
        {"command line: --http lacks its value, expected HOST:PORT or [IPV6]:PORT, as "
         "127.0.0.1:7340",
         "--http"},
        {"command line: --http lacks its value, expected HOST:PORT or [IPV6]:PORT, as "
         "127.0.0.1:7340",
         "--http", "--verbose"},
        {"command line: --http: expected HOST:PORT or [IPV6]:PORT, as 127.0.0.1:7340, found "
         "'a:99999'",
         "--http=a:99999"},
        {"command line: --verbose: expected true or false, found 'maybe'", "--verbose=maybe"},
        {"command line: --no-verbose takes no value", "--no-verbose=1"},
        {"command line: --verbose is given twice", "--verbose", "--verbose"},
        {"command line: unknown option '--room.a.zzz'; see gnomond --help", "--room.a.zzz", "1"},
        {"command line: unknown option '--room.a'; see gnomond --help", "--room.a", "1"},
        {"command line: '' is no name for a room: expected 1 to 32 letters, digits, '-' or '_'",
         "--room..scene", "1"},
        {"command line: too many words, unexpected b; usage: gnomond --config FILE [OPTION]... "
         "[WORD]",
         "a", "b"},
        {"command line: too many words, unexpected --verbose; usage: gnomond --config FILE "
         "[OPTION]... [WORD]",
         "a", "--", "--verbose"},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        char *argv[5] = {"gnomond"};
        int argc = 1;
        for (; argc < 5 && cases[i][argc] != NULL; argc++)
            argv[argc] = cases[i][argc];
        struct gn_options *o = NULL;
        struct gn_error e = {0};
        assert_int_equal(gn_options_load(&program, argc, argv, &o, &e), -EINVAL);
        assert_string_equal(e.text, cases[i][0]);
        assert_null(o);
    }
}

static void test_sets(void **unused)
{
    (void)unused;
    static const struct {
        const char *text;
        unsigned set;
    } right[] = {{"depth", 4}, {"shadow,depth", 5}, {"depth , shadow", 5},     {"none", 0},
                 {"all", 7},   {"added,added", 2},  {"shadow, added,depth", 7}};
    for (size_t i = 0; i < sizeof(right) / sizeof(right[0]); i++) {
        char text[128];
        struct gn_options *o = create();
        struct gn_error e = {0};
        snprintf(text, sizeof(text), "[room b]\nscene=s\n[room a]\nscene=s\nlayers = %s\n",
                 right[i].text);
        assert_int_equal(gn_options_read_text(o, text, "g.ini", &e), 0);
        assert_int_equal(gn_options_get_set(o, "room", "a", "layers"), right[i].set);
        assert_int_equal(gn_options_get_set(o, "room", "b", "layers"), 0); // unset
        gn_options_destroy(&o);
    }
    static const char *const wrong[][2] = {{"shadow,dept", "; did you mean 'depth'?"},
                                           {"shadow,", ""},
                                           {",shadow", ""},
                                           {"all,shadow", ""},
                                           {"shadow added", ""},
                                           {"xyz", ""}};
    for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++) {
        char text[128], expected[256];
        struct gn_options *o = create();
        struct gn_error e = {0};
        snprintf(text, sizeof(text), "[room a]\nlayers = %s\n", wrong[i][0]);
        snprintf(expected, sizeof(expected),
                 "g.ini:2: layers in [room a]: expected names of shadow, added, depth with commas "
                 "between them, or all, or none, found '%s'%s",
                 wrong[i][0], wrong[i][1]);
        assert_int_equal(gn_options_read_text(o, text, "g.ini", &e), -EINVAL);
        assert_string_equal(e.text, expected);
        gn_options_destroy(&o);
    }
}

static void test_secret(void **unused)
{
    (void)unused;
    static const struct gn_option secret[] = {
        {.section = "a", .key = "pin", .type = GN_OPTION_INT, .is_secret = true, .help = "Pin."},
        {.section = "a", .key = "mode", .type = GN_OPTION_ENUM, .choices = "x|y", .help = "M."}};
    static const struct gn_program small = {.name = "p", .options = secret, .n_options = 2};
    struct gn_options *o = NULL;
    struct gn_error e = {0};
    assert_int_equal(gn_options_create(&small, &o), 0);
    assert_int_equal(gn_options_read_text(o, "[a]\npin = hunter2\n", "g.ini", &e), -EINVAL);
    assert_null(strstr(e.text, "hunter2"));
    assert_int_equal(gn_options_get_enum(o, "a", NULL, "mode"), -1);
    gn_options_destroy(&o);
}

static void collect(void *context, const char *section, const char *name, const char *key,
                    const char *value, const char *source)
{
    char *text = context;
    snprintf(text + strlen(text), 1024 - strlen(text), "%s|%s|%s|%s|%s\n", section,
             name == NULL ? "" : name, key, value, source);
}

static void test_visit(void **unused)
{
    (void)unused;
    char text[1024] = "";
    struct gn_options *o = create();
    assert_int_equal(
        gn_options_read_text(o, "[room a]\nscene=s\n[server]\ntoken=t\n", "g.ini", NULL), 0);
    gn_options_visit(o, collect, text);
    assert_string_equal(text, "||verbose|no|default\n"
                              "server||listen|127.0.0.1:7340|default\n"
                              "server||max-sessions|8|default\n"
                              "server||token|(hidden)|g.ini:4\n"
                              "http||memory|64MiB|default\n"
                              "room|a|scene|s|g.ini:2\n"
                              "room|a|quality|interactive|default\n");
    gn_options_destroy(&o);
}

static void test_help(void **unused)
{
    (void)unused;
    char *const argv[] = {"gnomond", "--help", "--nonsense"};
    struct gn_options *o = NULL;
    assert_int_equal(gn_options_load(&program, 3, argv, &o, NULL), 0);
    assert_true(gn_options_wants_help(o));
    assert_false(gn_options_wants_version(o));
    gn_options_destroy(&o);

    char *text = NULL;
    size_t size = 0;
    FILE *file = open_memstream(&text, &size);
    gn_options_print_help(&program, file);
    fclose(file);
    for (const char *line = text; *line != '\0'; line += strcspn(line, "\n") + 1)
        assert_true(strcspn(line, "\n") <= 80);
    assert_non_null(strstr(text, "Usage: gnomond --config FILE [OPTION]... [WORD]\n"));
    assert_non_null(strstr(text,
                           "  --server-max-sessions N\n"
                           "      Sessions at one time. A whole number in [1, 64]. Default 8.\n"
                           "      File: [server] max-sessions. Environment: "
                           "GNOMON_SERVER_MAX_SESSIONS.\n"));
    assert_non_null(strstr(text, "  --room.NAME.scene FILE\n"));
    assert_non_null(strstr(text, "  --verbose, --no-verbose\n"));
    free(text);
}

/* Choices stand behind the flag while they fit in the line; the sentence has them always. */
static void test_help_with_long_choices(void **unused)
{
    (void)unused;
#define CHOICES "aaaaaaaaa|bbbbbbbbb|ccccccccc|ddddddddd|eeeeeeeeee|ffffffffffffffffffff"
    static const struct gn_option modes[] = {
        {.key = "mode", .type = GN_OPTION_ENUM, .choices = CHOICES, .help = "M."},
        {.key = "mode2", .type = GN_OPTION_ENUM, .choices = CHOICES, .help = "M."}};
    static const struct gn_program small = {
        .name = "p", .usage = "", .summary = "S.", .options = modes, .n_options = 2};
    char *text = NULL;
    size_t size = 0;
    FILE *file = open_memstream(&text, &size);
    gn_options_print_help(&small, file);
    fclose(file);
    for (const char *line = text; *line != '\0'; line += strcspn(line, "\n") + 1)
        assert_true(strcspn(line, "\n") <= 80);
    const char *first = strstr(text, "  --mode " CHOICES "\n");
    assert_non_null(first);
    assert_int_equal(strcspn(first, "\n"), 80);
    const char *second = strstr(text, "  --mode2 NAME\n      M. One of aaaaaaaaa,");
    assert_non_null(second);
    assert_non_null(strstr(second, "eeeeeeeeee"));
    free(text);
#undef CHOICES
}

/* The example is read back, as it is and with every comment sign before a key taken away. */
static void test_example(void **unused)
{
    (void)unused;
    char *text = NULL;
    size_t size = 0;
    FILE *file = open_memstream(&text, &size);
    gn_options_print_example(&program, file);
    fclose(file);
    struct gn_options *o = create();
    struct gn_error e = {0};
    assert_int_equal(gn_options_read_text(o, text, "example", &e), 0);
    assert_int_equal(gn_options_get_name_count(o, "room"), 0);
    gn_options_destroy(&o);

    for (char *c = text; *c != '\0'; c++)
        if (*c == '#' && c[1] != ' ' && (c == text || c[-1] == '\n') &&
            memcmp(c + strcspn(c, "\n") - 1, "=", 1) != 0) // leave keys without a default
            *c = ' ';
    o = create();
    assert_int_equal(gn_options_read_text(o, text, "example", &e), 0);
    assert_memory_equal(gn_options_get_source(o, "http", NULL, "memory"), "example:", 8);
    assert_int_equal(gn_options_get_enum(o, "room", "demo", "quality"), 1);
    gn_options_destroy(&o);
    free(text);
}

static void test_addresses(void **unused)
{
    (void)unused;
    struct gn_address a;
    assert_int_equal(gn_address_parse("[fe80::1]:65535", &a), 0);
    assert_string_equal(a.host, "fe80::1");
    assert_int_equal(a.port, 65535);
    static const char *const bad[] = {"",      ":1",    "a",       "a:",     "a:-1",  "a:+1",
                                      "a: 1",  "a:1x",  "a:65536", "::1:80", "[::1]", "[::1:80",
                                      "[]:80", "[x]:1", "a b:1",   "a\n:1",  "[:1",   "]:1"};
    for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++)
        assert_int_equal(gn_address_parse(bad[i], &a), -EINVAL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_defaults),
        cmocka_unit_test(test_precedence),
        cmocka_unit_test(test_ini_errors),
        cmocka_unit_test(test_long_lines),
        cmocka_unit_test(test_files),
        cmocka_unit_test(test_environment_errors),
        cmocka_unit_test(test_environment_of_others),
        cmocka_unit_test(test_argument_errors),
        cmocka_unit_test(test_sets),
        cmocka_unit_test(test_secret),
        cmocka_unit_test(test_visit),
        cmocka_unit_test(test_help),
        cmocka_unit_test(test_help_with_long_choices),
        cmocka_unit_test(test_example),
        cmocka_unit_test(test_addresses),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
