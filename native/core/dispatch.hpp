// The kernels of the processor at hand. A file that exports kernels of lanes declares them for each kind of processor by
// each_variant.hpp, and calls those that were chosen when the library was loaded.

#pragma once

#if defined(__x86_64__) || defined(_M_X64)
#define PRETOUCH_X86 1
#define CHOSEN(kernel) \
    (pretouch_chosen == 2 ? pretouch_avx512::kernel : pretouch_chosen == 1 ? pretouch_avx2::kernel : pretouch_base::kernel)
#else
#define CHOSEN(kernel) (pretouch_base::kernel)
#endif

extern int pretouch_chosen;
