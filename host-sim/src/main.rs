//! Command line of the workbench.

fn main() -> std::process::ExitCode {
    #[cfg(feature = "parquet")]
    haptic_log::guard::keep_guarded_panics_quiet();
    host_sim::cli::main()
}
