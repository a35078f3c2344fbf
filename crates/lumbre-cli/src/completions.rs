//! `lumbre completions` and `lumbre man`: for shells and manuals.

use std::path::PathBuf;

use clap::{Args, Command, CommandFactory};
use clap_complete::Shell;

use crate::failure::{Failure, print};

/// Prints a shell's completions of commands, options and their values.
#[derive(Args)]
#[command(after_help = "Examples:
  lumbre completions bash > ~/.local/share/bash-completion/completions/lumbre
  lumbre completions zsh > ~/.zfunc/_lumbre
  lumbre completions fish > ~/.config/fish/completions/lumbre.fish")]
pub(crate) struct CompletionsArguments {
    /// The shell.
    #[arg(value_enum)]
    shell: Shell,
}

/// Prints the manual page of the program or of a command, in the format of man.
#[derive(Args)]
#[command(after_help = "Examples:
  lumbre man | man -l -
  lumbre man render > ~/.local/share/man/man1/lumbre-render.1
  lumbre man --into ~/.local/share/man/man1")]
pub(crate) struct ManArguments {
    /// The command. By default the page of the whole program.
    #[arg(value_name = "COMMAND")]
    command: Option<String>,
    /// Write the pages of the program and of all its commands into this folder.
    #[arg(long, value_name = "DIR", conflicts_with = "command")]
    into: Option<PathBuf>,
}

/// Prints completions.
///
/// # Errors
/// [`Failure::Io`].
pub(crate) fn completions<P: CommandFactory>(arguments: &CompletionsArguments) -> Result<(), Failure> {
    let mut text = Vec::new();
    clap_complete::generate(arguments.shell, &mut P::command(), "lumbre", &mut text);
    print(&String::from_utf8_lossy(&text))
}

/// Prints a manual page, or writes all of them.
///
/// # Errors
/// [`Failure::Usage`] for an unknown command, and [`Failure::Io`].
pub(crate) fn man<P: CommandFactory>(arguments: &ManArguments) -> Result<(), Failure> {
    let mut program = P::command();
    if let Some(folder) = &arguments.into {
        let written = clap_mangen::generate_to(program, folder);
        return written.map_err(|e| Failure::Io(format!("{}: cannot write: {e}", folder.display())));
    }
    // So that usage lines have the whole name.
    program.build();
    let page = match arguments.command.as_deref() {
        None => program,
        Some(name) => match program.find_subcommand(name) {
            Some(command) => command.clone(),
            None => {
                let names: Vec<&str> =
                    program.get_subcommands().map(Command::get_name).filter(|name| *name != "help").collect();
                return Err(Failure::Usage(format!(
                    "there is no command \"{name}\" (expected {})",
                    names.join(", ")
                )));
            }
        },
    };
    let mut text = Vec::new();
    clap_mangen::Man::new(page).render(&mut text).map_err(|e| Failure::Io(format!("manual page: {e}")))?;
    print(&String::from_utf8_lossy(&text))
}
