/* From the resource location that an importer passes to a path: file URI (RFC 3986, RFC 8089) or plain path, in
   UTF-8.

       file:///C:/dir, file:/dir, file://localhost/dir     scheme and host are removed, %xx decoded
       file://host/share                                   Windows alone: a network share
       /dir, C:\dir                                        plain, as FMI 3.0 passes it

   A malformed escape, a zero byte, another scheme and a path that does not fit are refused. Windows opens files by
   UTF-16 and beyond 260 characters only by absolute paths with a prefix. */

#include "uri_path.h"

#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#define WIN32_LEAN_AND_MEAN
#include <windows.h>
#endif

static int hexadecimal_digit(char c) {
    if (c >= '0' && c <= '9') {
        return c - '0';
    }
    const char letter = (char)(c | 0x20);
    return letter >= 'a' && letter <= 'f' ? letter - 'a' + 10 : -1;
}

static char lower_case(char c) {
    return c >= 'A' && c <= 'Z' ? (char)(c | 0x20) : c;
}

/* Whether text begins with prefix, which is in lower case, in upper or lower case. */
static int starts_with(const char *text, const char *prefix) {
    for (; *prefix != '\0'; text++, prefix++) {
        if (lower_case(*text) != *prefix) {
            return 0;
        }
    }
    return 1;
}

static int has_drive(const char *path) {
    const char letter = lower_case(path[0]);
    return letter >= 'a' && letter <= 'z' && path[1] == ':';
}

/* Decode %xx of text; -1 if an escape is none or the result does not fit. A query or fragment means nothing in a
   file URI, so that a bare ? or # is taken as part of the name. */
static long decode(const char *text, char *path, size_t size) {
    size_t length = 0;
    for (; *text != '\0'; text++) {
        char c = *text;
        if (c == '%') {
            const int high = hexadecimal_digit(text[1]), low = high < 0 ? -1 : hexadecimal_digit(text[2]);
            if (low < 0 || (high == 0 && low == 0)) {
                return -1;
            }
            c = (char)(16 * high + low);
            text += 2;
        }
        if (length + 1 >= size) {
            return -1;
        }
        path[length++] = c;
    }
    path[length] = '\0';
    return (long)length;
}

/* Return where the path of a file URI begins, and whether a host stands before it: //host/share on Windows. */
static const char *after_scheme(const char *location, int *host) {
    const char *rest = location + strlen("file:");
    *host = 0;
    if (rest[0] != '/' || rest[1] != '/') {
        return rest;
    }
    rest += 2;
    if (starts_with(rest, "localhost/")) {
        return rest + strlen("localhost");
    }
    *host = rest[0] != '/' && !has_drive(rest);
    return rest;
}

/* Write the path of a file URI; its length, or -1. */
static long path_of_uri(const char *location, char *path, size_t size) {
    int host;
    const char *rest = after_scheme(location, &host);
#ifdef _WIN32
    if (host) {
        rest -= 2; /* the share's two slashes are the URI's */
    } else if (rest[0] == '/' && has_drive(rest + 1)) {
        rest++;
    }
#else
    if (host) { /* only Windows opens files of other hosts */
        return -1;
    }
#endif
    return decode(rest, path, size);
}

static long plain_path(const char *location, char *path, size_t size) {
    const size_t length = strlen(location);
    if (length >= size || strstr(location, "://") != NULL) {
        return -1;
    }
    memcpy(path, location, length + 1);
    return (long)length;
}

int resource_path(const char *location, const char *name, char *path, size_t size) {
    long length = starts_with(location, "file:") ? path_of_uri(location, path, size)
                                                 : plain_path(location, path, size);
    if (length <= 0 || (size_t)length + strlen(name) + 2 > size) {
        return 0;
    }
    if (path[length - 1] != '/' && path[length - 1] != '\\') {
        path[length++] = '/';
    }
    memcpy(path + length, name, strlen(name) + 1);
    return 1;
}

#ifdef _WIN32

/* Windows takes UTF-16, and paths beyond 260 characters only if they are absolute and begin with \\?\. */
static wchar_t *long_path(const wchar_t *name) {
    static const wchar_t DRIVE[] = L"\\\\?\\", SHARE[] = L"\\\\?\\UNC";
    const size_t room = sizeof SHARE / sizeof *SHARE;
    const DWORD size = GetFullPathNameW(name, 0, NULL, NULL);
    wchar_t *path = size > 0 ? malloc((room + size) * sizeof *path) : NULL;
    if (path == NULL) {
        return NULL;
    }
    wchar_t *full = path + room;
    GetFullPathNameW(name, size, full, NULL);
    if (full[0] == L'\\' && full[1] == L'\\' && full[2] != L'?' && full[2] != L'.') {
        memcpy(path, SHARE, sizeof SHARE); /* \\host becomes \\?\UNC\host: one slash goes */
        memmove(path + wcslen(SHARE), full + 1, (wcslen(full + 1) + 1) * sizeof *path);
    } else {
        memcpy(path, DRIVE, sizeof DRIVE);
        memmove(path + (full[1] == L':' ? wcslen(DRIVE) : 0), full, (wcslen(full) + 1) * sizeof *path);
    }
    return path;
}

FILE *open_file(const char *path) {
    const int size = MultiByteToWideChar(CP_UTF8, MB_ERR_INVALID_CHARS, path, -1, NULL, 0);
    wchar_t *name = size > 0 ? malloc((size_t)size * sizeof *name) : NULL;
    if (name == NULL) {
        return NULL;
    }
    MultiByteToWideChar(CP_UTF8, MB_ERR_INVALID_CHARS, path, -1, name, size);
    wchar_t *full = long_path(name);
    FILE *file = full != NULL ? _wfopen(full, L"rb") : NULL;
    free(full);
    free(name);
    return file;
}

#else

FILE *open_file(const char *path) {
    return fopen(path, "rb");
}

#endif
