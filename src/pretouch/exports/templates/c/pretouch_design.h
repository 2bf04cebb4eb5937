$about

#ifndef PRETOUCH_DESIGN_H
#define PRETOUCH_DESIGN_H

#include "pretouch_law.h"

#ifdef PRETOUCH_FLOAT
#define PRETOUCH_R(value) value##f
#else
#define PRETOUCH_R(value) value
#endif

typedef pretouch_state$suffix pretouch_design_state;

static const pretouch_parameters$suffix pretouch_design = {
$values
};

/* Prepare the state before the first step: no object is detected, and the robot rests at its reference. */
static inline void pretouch_design_start(pretouch_design_state *state) {
    pretouch_start$suffix(&pretouch_design, 0, 0, state);
}

/* Run one control period. */
static inline void pretouch_design_step(pretouch_design_state *state, const pretouch_sample *sample,
                                        pretouch_output *out) {
    $step(&pretouch_design, state, sample, out);
}

#endif
