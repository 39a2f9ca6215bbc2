#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

#include "ais_helpers.hpp"
#include "engine/ais/AisOptions.hpp"

namespace amiss {
namespace {

using namespace test;

TEST(AisOptions, NumbersOfChainsFollowTheDimension) {
  const AisOptions few = AisOptions().for_dimension(2), many = AisOptions().for_dimension(40);
  EXPECT_EQ(few.chains, 32);
  EXPECT_EQ(few.pilot_chains, 256);
  EXPECT_EQ(many.chains, 120);
  EXPECT_EQ(many.pilot_chains, 640);
  EXPECT_EQ(few.sweeps, 3);
  AisOptions own;
  own.chains = 5;
  own.sweeps = 0;
  own.max_sweeps = 2;
  EXPECT_EQ(own.for_dimension(40).chains, 5);
  EXPECT_EQ(own.for_dimension(40).sweeps, 2);
}

TEST(AisOptions, RefusesImpossibleValues) {
  const FunctionTarget flat(1, [](const VectorXd&) { return 0.0; });
  for (auto spoil :
       {+[](AisOptions& o) { o.groups = 1; }, +[](AisOptions& o) { o.chains = 3; },
        +[](AisOptions& o) { o.sweeps = -1; }, +[](AisOptions& o) { o.sweeps = 31; },
        +[](AisOptions& o) { o.max_sweeps = 0; }, +[](AisOptions& o) { o.max_groups = 7; },
        +[](AisOptions& o) { o.precision = 0.0; }, +[](AisOptions& o) { o.pilot_chains = 7; },
        +[](AisOptions& o) { o.ess_drop = 1.0; }, +[](AisOptions& o) { o.importance_draws = -1; },
        +[](AisOptions& o) { o.importance_draws = 1; }, +[](AisOptions& o) { o.max_components = 0; }}) {
    AisOptions options;
    spoil(options);
    EXPECT_THROW(sample_ais(flat, options, Context()), std::invalid_argument);
  }
}

}  // namespace
}  // namespace amiss
