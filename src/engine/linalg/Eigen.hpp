// The one door to Eigen: its headers are treated as the system's, so that -Wall stays readable.
#pragma once
#pragma GCC system_header
#include <Eigen/Dense>
