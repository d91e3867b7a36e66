//! `replica new-stage`: a folder with a stage to start from.

use anyhow::{Context, bail};
use command_line::usage_error::UsageError;
use files::regular_file;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Names of tables that a stage cannot have.
const TAKEN: [&str; 3] = ["run", "simulate", "settings"];

/// Write a folder with a stage, and a launch file that uses it.
///
/// The stage classifies the points of submaps by their height. It passes `replica-launch launch.toml --check`; the guides "Write your
/// own stage" and "Use Python" explain what to change.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage\n\n\
                  Example: replica new-stage my_stage --lang python")]
pub struct Args {
    /// Name of the stage, of its folder and of its table in the launch file
    name: String,
    /// Language of the stage
    #[arg(long, default_value = "rust")]
    lang: Language,
    /// Folder in which the folder of the stage is created
    #[arg(long, value_name = "DIR", default_value = ".")]
    out: PathBuf,
    /// Source tree of REPLICA, whose crate `stage` a stage in Rust uses [default: the one that this program was built from]
    #[arg(long, value_name = "DIR")]
    source: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Language {
    Rust,
    Python,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let name = &args.name;
    let is_plain = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_';
    if !name.bytes().all(is_plain) || !name.starts_with(|c: char| c.is_ascii_lowercase()) {
        let text = format!("{name}: must have only lower-case letters, digits and _, and start with a letter");
        return Err(UsageError(text).into());
    }
    if TAKEN.contains(&name.as_str()) {
        return Err(UsageError(format!("{name}: is a table of its own in the launch file")).into());
    }
    let folder = args.out.join(name);
    if folder.exists() {
        bail!("{}: exists already", folder.display());
    }
    let (files, build) = match args.lang {
        Language::Rust => (rust(args)?, "cargo build --release && "),
        Language::Python => (python(), ""),
    };
    for (file, text) in files {
        write(&folder.join(file.replace("{name}", name)), &text.replace("{name}", name))?;
    }
    println!("cd {} && {build}replica-launch launch.toml --check", folder.display());
    Ok(ExitCode::SUCCESS)
}

/// Files and texts of a stage; `{name}` stands for its name.
type Files = Vec<(&'static str, String)>;

fn rust(args: &Args) -> anyhow::Result<Files> {
    let built_from = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let source = args.source.clone().unwrap_or_else(built_from);
    let source = source
        .canonicalize()
        .with_context(|| format!("{}: no source tree of REPLICA; name one with --source DIR", source.display()))?;
    let library = source.join("shared/stage");
    if !library.join("Cargo.toml").is_file() {
        bail!(
            "{}: has no crate `stage` in shared/stage; name a source tree of REPLICA with --source DIR",
            source.display()
        );
    }
    let manifest = include_str!("new_stage/manifest.toml").replace("{library}", &library.display().to_string());
    let lock = source.join("Cargo.lock");
    let locked = regular_file::read_to_string(&lock).with_context(|| lock.display().to_string())?;
    Ok(vec![
        ("Cargo.toml", manifest),
        // The versions that the programs were built with.
        ("Cargo.lock", locked),
        ("src/main.rs", include_str!("new_stage/stage.rs").to_owned()),
        ("launch.toml", launch_file("program = \"target/release/{name}\"")),
    ])
}

fn python() -> Files {
    let keys = "program = \"{name}.py\"\npython = \"python3\"         # or an interpreter, as \"venv/bin/python\"";
    vec![("{name}.py", include_str!("new_stage/stage.py").to_owned()), ("launch.toml", launch_file(keys))]
}

fn launch_file(keys: &str) -> String {
    include_str!("new_stage/launch.toml").replace("{keys}", keys)
}

fn write(path: &Path, text: &str) -> anyhow::Result<()> {
    let at = || path.display().to_string();
    std::fs::create_dir_all(path.parent().unwrap_or(Path::new("."))).with_context(at)?;
    std::fs::write(path, text).with_context(at)?;
    if text.starts_with("#!") {
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o755)).with_context(at)?;
    }
    Ok(())
}
