//! `replica rig`: makes, checks and refines the rig of a drive.

mod calibrate;
mod check;
mod new;
mod questions;
mod secondary_lidar;

use clap::Subcommand;
use command_line::argument::words;
use registration::SpinDirection;
use rig::survey::SurveySettings;
use std::path::PathBuf;
use std::process::ExitCode;

/// Make, check or refine the rig of a drive.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage, 3 check: doubts\n\n\
                  Example: replica rig check drives/mine")]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    New(Box<new::Args>),
    Check(check::Args),
    Calibrate(calibrate::Args),
}

/// A drive, and the part of it that is read.
#[derive(clap::Args, Debug)]
struct PartOfDrive {
    /// Drive folder
    drive: PathBuf,
    /// Start, s after the first sweep
    #[arg(long, default_value_t = 0.0, value_parser = command_line::argument::not_negative)]
    start: f64,
    /// Longest part that is read, s
    #[arg(long, default_value_t = 60.0, value_parser = command_line::argument::positive)]
    seconds: f64,
    /// Sense in which the LiDAR turns if its points have no times: the setting `untimed_turn` of `slam_aggregate`
    #[arg(long, default_value_t = UntimedTurn::None, value_parser = words::<UntimedTurn>())]
    untimed_turn: UntimedTurn,
}

settings::words! {
    /// Sense in which a LiDAR without point times turns.
    enum UntimedTurn {
        /// The sweeps are rigid.
        None = "none",
        /// Clockwise seen from above.
        Clockwise = "clockwise",
        /// Counterclockwise seen from above.
        Counterclockwise = "counterclockwise",
    }
}

impl PartOfDrive {
    fn settings(&self) -> SurveySettings {
        let untimed_turn = match self.untimed_turn {
            UntimedTurn::None => None,
            UntimedTurn::Clockwise => Some(SpinDirection::Clockwise),
            UntimedTurn::Counterclockwise => Some(SpinDirection::Counterclockwise),
        };
        SurveySettings { start_s: self.start, seconds: self.seconds, untimed_turn }
    }
}

pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    match &args.command {
        Command::New(args) => new::run(args),
        Command::Check(args) => check::run(args),
        Command::Calibrate(args) => calibrate::run(args),
    }
}
