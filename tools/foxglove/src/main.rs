//! `replica-foxglove`: shows recordings and running pipelines in Foxglove.
//!
//! `convert` writes a recording of topics as an MCAP file of Foxglove's messages; `live` observes a run and serves the same messages over
//! Foxglove's WebSocket protocol. Both take their messages from `scene`, so that a recording and a run look the same.
//!
//! Clouds, boxes and transforms are in the frame `odom`. The placement of the submaps in the world is not applied.
//!
//! It must never slow a run down or change it: it observes without back-pressure, and points above `--points` are left out evenly. It
//! listens on the address that is given and on no other.
//!
//! Start reading at `scene`, which turns one message of a topic into Foxglove's, then `convert` and `live`.

mod clouds;
mod convert;
mod live;
mod objects;
mod scene;
mod submaps;

use clap::{Parser, Subcommand};
use std::net::IpAddr;
use std::path::PathBuf;
use std::process::ExitCode;

/// Show recordings and running pipelines in Foxglove, Lichtblick and other programs with Foxglove's messages.
#[derive(Parser, Debug)]
#[command(name = "replica-foxglove", version, after_help = "Exit codes: 0 done or Ctrl-C, 1 failed, 2 wrong usage")]
struct Args {
    /// Largest number of points shown of a submap; others are left out evenly
    #[arg(long, global = true, value_name = "N", default_value_t = 400_000, value_parser = clap::value_parser!(u32).range(1..))]
    points: u32,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Convert a recording of `replica record` or `replica-launch --record`
    Convert {
        /// The recording
        recording: PathBuf,
        /// MCAP file with Foxglove's messages; must not exist
        #[arg(long, value_name = "FILE")]
        out: PathBuf,
    },
    /// Serve a running pipeline by Foxglove's WebSocket protocol, until it ends or Ctrl-C
    Serve {
        /// Output folder of the run
        #[arg(long, value_name = "DIR")]
        run: PathBuf,
        /// Address to listen on; other addresses than localhost can be reached from the network, without a password
        #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1")]
        bind: IpAddr,
        /// Port; 0 takes a free one
        #[arg(long, default_value_t = 8765)]
        port: u16,
    },
}

fn main() -> ExitCode {
    let Args { points, command } = Args::parse();
    let points = points as usize;
    let result = match command {
        Command::Convert { recording, out } => convert::convert(&recording, &out, points),
        Command::Serve { run, bind, port } => live::serve(&run, bind, port, points),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}
