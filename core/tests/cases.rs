//! Random cases that shrink, for the tests of several crates.

use proptest::strategy::Strategy;
use proptest::test_runner::{Config, RngAlgorithm, RngSeed, TestCaseResult, TestRunner};

/// So many random cases of a seed hold, or PROPTEST_CASES of them. Of one that does not, the smallest that was found is shown.
pub(crate) fn cases<S: Strategy>(seed: u64, count: u32, of: &S, holds: impl Fn(S::Value) -> TestCaseResult) {
    let mut config = Config::default();
    if std::env::var_os("PROPTEST_CASES").is_none() {
        config.cases = count;
    }
    (config.rng_algorithm, config.rng_seed) = (RngAlgorithm::XorShift, RngSeed::Fixed(seed));
    (config.failure_persistence, config.max_shrink_iters) = (None, 100_000);
    let found = TestRunner::new(config).run(of, holds);
    found.unwrap_or_else(|error| panic!("{error}"));
}
