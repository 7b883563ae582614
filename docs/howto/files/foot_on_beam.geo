// A foot on a beam, millimetres. Two surfaces that share no points: contact needs two lines.
Point(1) = {0, -10, 0, 4};  Point(2) = {100, -10, 0, 4};
Point(3) = {100, 0, 0, 4};  Point(4) = {0, 0, 0, 4};
Line(1) = {1, 2};  Line(2) = {2, 3};  Line(3) = {3, 4};  Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};  Plane Surface(1) = {1};

Point(11) = {40, 0, 0, 2};   Point(12) = {60, 0, 0, 2};
Point(13) = {60, 15, 0, 3};  Point(14) = {40, 15, 0, 3};
Line(11) = {11, 12};  Line(12) = {12, 13};  Line(13) = {13, 14};  Line(14) = {14, 11};
Curve Loop(11) = {11, 12, 13, 14};  Plane Surface(11) = {11};

// A physical group for every surface and for every curve.
Physical Surface("beam") = {1};
Physical Surface("foot") = {11};
Physical Curve("ends") = {2, 4};
Physical Curve("beam_top") = {3};
Physical Curve("foot_sole") = {11};
Physical Curve("foot_top") = {13};
Physical Curve("free") = {1, 12, 14};
