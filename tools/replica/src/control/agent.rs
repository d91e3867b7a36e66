//! `replica agent`: runs stages for runs on other hosts.

use anyhow::Context;
use command_line::{say, say_error};
use link::Key;
use link::agent::Agent;
use run::exit;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Run stages for runs on other hosts.
///
/// A stage whose table has `host = "HOST:PORT"` runs there, as a program that this command starts. Connections are encrypted and
/// need the key. Relative paths of a stage's settings, such as its model, start in FOLDER. Runs until it is killed; the stages
/// end with it.
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit codes: 1 the address cannot be used, 2 wrong usage, 78 the key file is refused\n\n\
                  Example: replica agent --listen 0.0.0.0:7878 --key agent.key")]
pub struct Args {
    /// Address to listen on; port 0 picks one
    #[arg(long, value_name = "HOST:PORT", required_unless_present = "new_key")]
    listen: Option<String>,
    /// Key file, which only its owner may read; the runs have the same
    #[arg(long, value_name = "FILE", required_unless_present = "new_key")]
    key: Option<PathBuf>,
    /// Folder of models and of programs that launch files name
    #[arg(long, value_name = "FOLDER", default_value = ".")]
    folder: PathBuf,
    /// Write a new key and exit
    #[arg(long, value_name = "FILE", conflicts_with_all = ["listen", "key", "folder"])]
    new_key: Option<PathBuf>,
}

/// Runs the command. The address goes to stdout, lines about connections to stderr.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    match (&args.new_key, &args.listen, &args.key) {
        (Some(file), ..) => {
            Key::create(file)?;
            say!("{}: copy it to the other host, e.g. by scp -p", file.display())?;
            Ok(ExitCode::SUCCESS)
        }
        (None, Some(address), Some(key)) => listen(address, key, &args.folder),
        // The parser has refused this.
        _ => Ok(ExitCode::from(exit::USAGE)),
    }
}

fn listen(address: &str, key: &Path, folder: &Path) -> anyhow::Result<ExitCode> {
    let key = match Key::read(key) {
        Ok(key) => key,
        Err(error) => {
            say_error!("error: {error}");
            return Ok(ExitCode::from(exit::CONFIGURATION));
        }
    };
    let folder = folder.canonicalize().with_context(|| folder.display().to_string())?;
    let listener = TcpListener::bind(address).with_context(|| address.to_owned())?;
    say!("listening on {}, programs and models of {}", listener.local_addr()?, folder.display())?;
    let report = |line: &str| say_error!("{line}");
    Agent::new(key, folder, env!("REPLICA_VERSION").to_owned(), report).serve(&listener);
    Ok(ExitCode::SUCCESS)
}
