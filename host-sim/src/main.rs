//! Command line of the workbench.

mod cli;

fn main() -> std::process::ExitCode {
    cli::main()
}
