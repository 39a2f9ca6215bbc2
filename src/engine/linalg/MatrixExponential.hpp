// The door to Eigen's matrix exponential (Higham 2005, SIAM J. Matrix Anal. Appl. 26, 1179-1193).
#pragma once
#pragma GCC system_header
#include <unsupported/Eigen/MatrixFunctions>
