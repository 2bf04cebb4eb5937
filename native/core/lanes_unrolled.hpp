// Loops whose counter is a constant in every pass, so that what they index can lie in registers.

#pragma once

namespace PRETOUCH_VARIANT {

namespace {

template <int I> struct Place {
    static constexpr int value = I;
};

// body(Place<FROM>), ..., body(Place<TO - 1>)
template <int FROM, int TO, class Body> __attribute__((always_inline)) inline void unrolled(Body body) {
    if constexpr (FROM < TO) {
        body(Place<FROM>{});
        unrolled<FROM + 1, TO>(body);
    }
}

}  // namespace

}  // namespace PRETOUCH_VARIANT
