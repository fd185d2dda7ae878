 ; SIGN UNVERIFIED: do the sign test of the commissioning sheet before cutting.
 ; Model: patent CN1868666, two sensors
 ;   Z = -1.871 + 6.0476*dT1 + 2.6667*dT3 [um]
 ;   Y = 0.5703 + 4.7292*dT1 - 0.5908*dT3 [um]
 ; The correction of an axis is the negative of its displacement.
 ; Equations SHA-256 a6dda75b221d0a842068d1621f8510b36cdd362cdb3044be21d7c187f108c47f
 ; Written by selector
 ; Single precision: largest difference to the float64 model inside the valid ranges: Z 0.00013 um, Y 7.8e-05 um,
 ;   for readings up to T1 70 degC, T3 70 degC, called at most 100 times a second.
 ; Once a second; set global.selector_is_running = false ends it, e.g. to edit
 ; this file. Without the loop the firmware would call it every ten seconds.
while exists(global.selector_is_running) && global.selector_is_running
  M98 P"selector_correction.g"
  G4 S1
