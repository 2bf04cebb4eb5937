// Declares what PRETOUCH_LANES, the header of a file of lanes, declares: once for each kind of processor.

#define PRETOUCH_VARIANT pretouch_base
#include PRETOUCH_LANES
#undef PRETOUCH_VARIANT
#ifdef PRETOUCH_X86
#define PRETOUCH_VARIANT pretouch_avx2
#include PRETOUCH_LANES
#undef PRETOUCH_VARIANT
#define PRETOUCH_VARIANT pretouch_avx512
#include PRETOUCH_LANES
#undef PRETOUCH_VARIANT
#endif
