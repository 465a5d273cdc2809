/*
@facts
 *
 * The equations and their sources: docs/export.md and the Rust crate piezotrack-control, which this
 * follows operation by operation. Compiled without fused multiply-add it gives the same bits.
 */
#include <stdbool.h>

#include "NAME.h"

#ifdef __FAST_MATH__
#error "compile without -ffast-math: a reading that is NaN would pass for a measurement"
#endif

typedef NAME_real real;

#include "constants.h"

#include "numbers.c"

#include "readings.c"

#if FILTERED
#include "filters.c"

#endif
#if LAW_ANY
#include "laws/sample.c"

#endif
#if LAW_SPACE
#include "laws/state_space.c"

#endif
#if LAW_PID
#include "laws/pid.c"

#endif
#if LAW_SLIDING
#include "laws/sliding_mode.c"

#endif
#if LAW_DISTURBANCE
#include "laws/disturbance_observer.c"

#endif
#if DAHL_OPERATOR
#include "dahl_operator.c"

#endif
#if LAW_DAHL
#include "laws/dahl_observer.c"

#endif
#if LAW_DAMPED
#include "laws/damping.c"

#endif
#if LAW_ANY
#include "laws/outermost.c"

#endif
#if REPEATS
#include "repetitive.c"

#endif
#if FORWARD_TABLE
#include "feedforward/table.c"

#endif
#if FORWARD_ONLINE
#include "feedforward/square_root.c"

#include "feedforward/dahl_inverse.c"

#endif
#include "loop.c"
#if TUNED

#include "settings.c"
#endif
