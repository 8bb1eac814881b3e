# Files that are one translation unit and one program with ESOKIT_TESTS_TOGETHER: a program a line, called
# by its first file. Those that instantiate the same types sit together (chosen by the code that their
# programs had in common), as many as GCC compiles within some 2 GB. Of one line: either law suites, or
# tests that count allocations (support/no_allocation.hpp, which replaces operator new), or neither. A file
# in no line is by itself.
set(esokit_units
    "adapter/decorators adapter/outlier_gate"
    "adapter/guarded adapter/guarded_model adapter/measured"
    "analysis/controllers analysis/margins"
    "analysis/covariance analysis/disturbance_alarm analysis/frequency_response analysis/loop"
    "analysis/dense analysis/integrator_chain analysis/peak_gain"
    "control/absurd_numbers control/adrc control/controller_static control/missing_samples control/nonlinear_feedback control/pack control/softening"
    "control/adrc_law control/health control/pairs_law control/reconvergence control/time_proportioned control/tracking_differentiator"
    "control/explicit_instantiation_static control/follow_profile control/packed control/retune control/settings_law control/smooth_profile"
    "control/disturbance_compensator control/experiment control/mimo_adrc control/predictive_adrc"
    "control/linear_controller_laws control/varying_gain_controller_laws"
    "core/check core/expected core/lanes core/matrix core/pack core/scalar core/snapshot"
    "examples/algebraic_filter examples/clock examples/error_bound examples/sign_differentiator"
    "gain/algebraic_gain gain/riccati gain/sampled_gain"
    "gain/continuous_gain gain/covariance_factor gain/feedback_gain gain/gain_interval gain/gain_law gain/gain_law_static gain/switching_certificate"
    "identify/fit identify/identify identify/input_checks identify/late_input identify/measured_columns identify/second_opinion identify/smooth"
    "math/combinatorics math/fal math/positivity"
    "model/augmented_model model/linear_plant model/plant_model"
    "observer/absurd_numbers observer/adjustable_bandwidth_eso observer/given_values observer/reconvergence"
    "observer/algebraic_eso observer/cascade_identities observer/observer_static observer/predictor_corrector observer/random_config observer/refused_config observer/update_on_paper"
    "observer/archetype_scalars observer/concepts_static observer/model_seam"
    "observer/named_observer observer/nonlinear_eso observer/pack"
    "observer/adjustable_bandwidth_eso_laws observer/cascade_eso_laws observer/half_gain_eso_laws observer/linear_eso_laws observer/own_observer_laws observer/pole_set_laws"
    "observer/algebraic_eso_laws observer/extended_state_filter_laws observer/model_eso_laws observer/model_parts_laws observer/nonlinear_eso_laws"
    "sim/closed_loop sim/dormand_prince sim/metrics sim/noise sim/plant sim/refused_config sim/runge_kutta sim/signals"
    "sim/counted_gaussian sim/run sim/study_records"
    "target/c_boundary target/c_code target/c_self_test"
    "target/c_reference target/c_resting target/c_saved target/c_state"
    "target/health_code target/profile_code target/time_proportioned_code"
    "tune/pid_conversion tune/tune tune/update_operations")
