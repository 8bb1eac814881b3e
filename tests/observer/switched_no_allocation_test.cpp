// `make` of AdjustableBandwidthEso and NonlinearEso allocates nothing.
#include <support/no_allocation.hpp>
//
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>

namespace esokit_test {

namespace observer_switched_no_allocation_test {

TEST(NoAllocation, CountsWhatEigenAllocates) {
  const NoAllocation guard;
  const Eigen::VectorXd vector = Eigen::VectorXd::Ones(guard.count() == 0 ? 100 : 1);
  EXPECT_EQ(vector.sum(), 100);
  EXPECT_EQ(guard.count(), 1);
}

TEST(SwitchedObservers, MakeAllocatesNothing) {
  bool made = true;
  long count = -1;
  {
    const NoAllocation guard;
    made = esokit::AdjustableBandwidthEso<2>::make({.observer_bandwidth = 50,
                                                    .bandwidth_ratio = 0.7,
                                                    .rule = esokit::SwitchingRule::beso,
                                                    .input_gain = 1,
                                                    .sample_time = 0.01})
               .has_value();
    made = made && esokit::NonlinearEso<6, float>::make(
                       {.observer_bandwidth = 50, .input_gain = 1, .sample_time = 0.01f})
                       .has_value();
    made = made && esokit::NonlinearEso<2>::report(
                       {.observer_bandwidth = 50, .input_gain = 1, .sample_time = 0.01})
                       .has_value();
    count = guard.count();
  }
  EXPECT_TRUE(made);
  EXPECT_EQ(count, 0);
}

}  // namespace observer_switched_no_allocation_test
}  // namespace esokit_test
