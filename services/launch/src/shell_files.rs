//! Files for the shell, written from the definition of the command line: completions and a man page.

use crate::print;
use clap::Command;
use clap_complete::{Shell, generate};
use run::exit;
use std::path::PathBuf;
use std::process::ExitCode;

/// Options that write such a file and start nothing.
#[derive(clap::Args)]
pub struct ShellFiles {
    /// Print the completions of a shell
    #[arg(long, value_name = "SHELL")]
    completions: Option<Shell>,
    /// Write the man page into this folder
    #[arg(long, value_name = "DIR")]
    man: Option<PathBuf>,
}

impl ShellFiles {
    /// Writes the requested files; `None` if none was requested.
    pub fn write(&self, mut command: Command) -> Option<ExitCode> {
        if let Some(folder) = &self.man {
            let written = std::fs::create_dir_all(folder).and_then(|()| clap_mangen::generate_to(command, folder));
            return Some(match written {
                Ok(()) => ExitCode::from(exit::DONE),
                Err(error) => {
                    tracing::error!("{}: cannot write the man page: {error}", folder.display());
                    ExitCode::from(exit::FAILED)
                }
            });
        }
        let shell = self.completions?;
        let mut text = Vec::new();
        generate(shell, &mut command, "replica-launch", &mut text);
        Some(print(&String::from_utf8_lossy(&text)))
    }
}
