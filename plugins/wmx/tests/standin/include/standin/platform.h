// Declarations that the vendor's headers take from windows.h. Part of the stand-in.
#pragma once

#include <cstdint>

typedef void *HANDLE;
typedef std::uintptr_t DWORD_PTR;
typedef int BOOL;
#ifndef INFINITE
#define INFINITE 0xFFFFFFFFu
#endif
#ifndef FALSE
#define FALSE 0
#define TRUE 1
#endif
