/* From the resource location that an importer passes to a file that can be opened. */

#ifndef URI_PATH_H
#define URI_PATH_H

#include <stddef.h>
#include <stdio.h>

/* Write the path, in UTF-8, of the file called name in the folder location: a file URI (RFC 3986, RFC 8089) or, as
   FMI 3.0 has it, a plain path. Return 1; 0 if the URI is malformed or of another scheme, if it holds a zero byte, or
   if the path is longer than size. */
int resource_path(const char *location, const char *name, char *path, size_t size);

/* Open the file at a path in UTF-8 for reading; NULL if it cannot be. */
FILE *open_file(const char *path);

#endif
