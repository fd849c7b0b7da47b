/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "common/image_file.h"
#include "common/json.h"
#include "tests/rig/sequence.h"

int gn_rig_sequence_read(const char *directory, struct gn_rig_sequence *out_sequence,
                         struct gn_error *out_error)
{
    struct gn_rig_sequence s = {0};
    struct gn_json root;
    char path[4096];
    if (strlen(directory) >= sizeof(s.directory))
        return gn_error_set(out_error, -EINVAL, "the sequence's folder has too long a name");
    snprintf(s.directory, sizeof(s.directory), "%s", directory);
    snprintf(path, sizeof(path), "%s/sequence.json", directory);
    int result = gn_json_load_file(path, &root, out_error);
    if (result)
        return result;
    const char *format = json_string_value(json_object_get(root.value, "format"));
    s.root = root.value;
    s.frames = json_object_get(s.root, "frames");
    bool good = format && !strcmp(format, "gnomon-sequence 1") && json_is_array(s.frames) &&
                json_array_size(s.frames) >= 1 && json_array_size(s.frames) <= GN_RIG_MAX_FRAMES;
    for (size_t i = 0; good && i < json_array_size(s.frames); i++)
        good = gn_rig_sequence_get_text(&s, (int)i, "picture") != NULL;
    if (!good) {
        gn_json_finish(&root);
        return gn_error_set(out_error, -EINVAL,
                            "%s: need the format \"gnomon-sequence 1\" and 1 to %d frames with "
                            "pictures",
                            path, GN_RIG_MAX_FRAMES);
    }
    *out_sequence = s;
    return 0;
}

void gn_rig_sequence_finish(struct gn_rig_sequence *sequence)
{
    json_decref(sequence->root);
    memset(sequence, 0, sizeof(*sequence));
}

const char *gn_rig_sequence_get_text(const struct gn_rig_sequence *sequence, int index,
                                     const char *key)
{
    return json_string_value(json_object_get(json_array_get(sequence->frames, (size_t)index), key));
}

const char *gn_rig_sequence_get_name(const struct gn_rig_sequence *sequence, int index)
{
    const char *picture = gn_rig_sequence_get_text(sequence, index, "picture");
    const char *slash = strrchr(picture, '/');
    return slash ? slash + 1 : picture;
}

int gn_rig_read_picture(const char *directory, const char *name, struct gn_image8 *out_image,
                        struct gn_error *out_error)
{
    struct gn_image_file file;
    char path[4096];
    snprintf(path, sizeof(path), "%s/%s", directory, name);
    int result = gn_image_read_file(path, &file, out_error);
    if (result)
        return result;
    int channels = file.codes8.channels;
    if (file.kind != GN_IMAGE_CODES8) {
        gn_image_file_finish(&file);
        return gn_error_set(out_error, -EINVAL, "%s: need an 8-bit picture", path);
    }
    struct gn_image8 image;
    result = gn_image8_init(&image, file.codes8.width, file.codes8.height, 3);
    for (size_t i = 0; result == 0 && i < (size_t)image.width * (size_t)image.height; i++)
        for (size_t k = 0; k < 3; k++)
            image.data[3 * i + k] =
                file.codes8.data[(size_t)channels * i + (channels >= 3 ? k : 0)];
    gn_image_file_finish(&file);
    if (result)
        return gn_error_set(out_error, result, "%s: no memory for it", path);
    *out_image = image;
    return 0;
}
