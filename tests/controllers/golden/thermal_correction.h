/*
 * SIGN UNVERIFIED: do the sign test of the commissioning sheet before cutting.
 * Model: patent CN1868666, two sensors
 *   Z = -1.871 + 6.0476*dT1 + 2.6667*dT3 [um]
 *   Y = 0.5703 + 4.7292*dT1 - 0.5908*dT3 [um]
 * The correction of an axis is the negative of its displacement.
 * Equations SHA-256 a6dda75b221d0a842068d1621f8510b36cdd362cdb3044be21d7c187f108c47f
 * Written by selector
 */
#ifndef THERMAL_CORRECTION_H
#define THERMAL_CORRECTION_H

typedef struct thermal_correction {
    /* inputs */
    double dt_s; /* time since the last call [s] */
    double reading_1; /* T1 [degC] */
    double reading_2; /* T3 [degC] */
    int is_ready; /* drives on and axis referenced */
    int is_wanted; /* the operator's switch */
    int is_restart; /* true in the first call after the control was off */
    double standstill_s; /* with is_restart: off for so long [s] */
    double test_um_1; /* sign test of Z: not 0 commands so much [um] */
    double test_um_2; /* sign test of Y: not 0 commands so much [um] */
    /* outputs */
    int sensor_1; /* T1: 0 ok, 1 limited, 2 recovering, 3 missing, 4 break code, 5 out of limits, 6 jump, 7 stuck, 8 range */
    int sensor_2; /* T3 */
    double correction_1; /* to be added to the axis for Z [um] */
    double k0_1; /* the same at the reference position [um] */
    double correction_2; /* to be added to the axis for Y [um] */
    double k0_2; /* the same at the reference position [um] */
    int mode; /* 0 off, 1 model, 2 hold, 3 ramp to zero, 4 switched off, 5 sign test, 10 and more: fallback */
    /* to be kept when the control is off */
    int has_memory_1; /* memory has begun */
    double start_1; /* start reading of T1 */
    int has_start_1; /* start reading is taken */
    int has_memory_2; /* memory has begun */
    double start_2; /* start reading of T3 */
    int has_start_2; /* start reading is taken */
    /* state */
    double x_1; /* T1 as the model gets it */
    double since_1; /* since it was believed last [s] */
    double good_for_1; /* good for so long [s]; -1: not good */
    int is_new_1; /* not believed since the control started */
    double x_2; /* T3 as the model gets it */
    double since_2; /* since it was believed last [s] */
    double good_for_2; /* good for so long [s]; -1: not good */
    int is_new_2; /* not believed since the control started */
    double aim_1; /* where it moves to [um] */
    double rest_1; /* what rounding left of its last step [um] */
    double aim_2; /* where it moves to [um] */
    double rest_2; /* what rounding left of its last step [um] */
    int was_restart; /* is_restart in the call before */
    int is_first; /* no sample yet */
    double since_sample_s; /* since the last sample [s] */
    double held_s; /* held for so long [s] */
    double test_left_s; /* a sign test may go on for so long [s] */
    int follows; /* as mode, while ready and wanted */
} thermal_correction;

/* Once, before the first call. */
void thermal_correction_init(thermal_correction *m);
/* Every cycle, after the inputs are set; the outputs are in the struct. */
void thermal_correction_step(thermal_correction *m);

#endif
