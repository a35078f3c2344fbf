//! The `lumbre` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    lumbre_cli::run(std::env::args_os().collect()).into()
}
