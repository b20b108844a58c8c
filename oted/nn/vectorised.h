#pragma once
/// OTED_VECTORISED: one version of a function per instruction set; the loader picks. Sanitizers cannot run before the
/// choice is made.

#if defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__)
#define OTED_VECTORISED __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define OTED_VECTORISED
#endif
