(job: golden.toml)
(cutter: kind "torus")
(units: mm and degrees)
(X: travel along the spindle axis, 0 is the part's)
(Y: attack axis, from the spindle axis to the tool centre)
(A: turn of the part about X, right-handed)
(under G93 F is 1/min)
(start the cutter before this program: it starts no spindle and changes no)
(tool)
G21 G90 G17 G40 G49 G80 G94
G0 Y122.035
G0 X-8.25 A0
G1 Y96.948 F1500
G93
G1 X-8 Y91.437 A45 F51.6829
G1 X-7.75 Y101.911 A90 F48.1304
G1 X-7.5 Y99.569 A135 F48.6224
G1 X-7.25 Y63.113 A180 F34.3621
G1 X-7 Y68.656 A225 F77.1659
G1 X-6.75 Y58.212 A270 F72.7608
G1 X-6.5 Y60.585 A315 F90.7055
G1 X-6.25 Y97.072 A360 F34.7278
G1 X-6 Y91.56 A405 F51.6825
G1 X-5.75 Y102.035 A450 F48.1299
G1 X-5.5 Y99.692 A495 F48.6223
G1 X-5.25 Y63.237 A540 F34.3627
G94
G0 Y122.035
M2
