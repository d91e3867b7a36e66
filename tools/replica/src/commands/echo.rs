//! `replica echo`: the messages of a topic, decoded by its byte table.

mod layout;

use crate::attach::{RunArgument, Tap, TapEvent, Usage};
use crate::terminal::StopFlag;
use ipc::Looking;
use layout::{Format, Layout};
use stage::exit;
use std::io::{BufWriter, Write};

/// Prints the messages of a topic as they come: envelope, header, and the first rows.
#[derive(clap::Args, Debug)]
pub struct Args {
    /// The topic; `replica topics` lists them.
    topic: String,
    #[command(flatten)]
    run: RunArgument,
    /// Rows of each message to print.
    #[arg(long, value_name = "N", default_value_t = 10)]
    rows: usize,
    /// Messages to print; without it until the run ends or Ctrl-C.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    count: Option<u64>,
    /// Fields of header and rows to print [default: all].
    #[arg(long, value_name = "NAME,…", value_delimiter = ',')]
    fields: Vec<String>,
    /// The producer waits for this terminal: from the first message on none is missed. A pipe that is read slowly slows
    /// the run, one that is not read stops it.
    #[arg(long)]
    lossless: bool,
    /// One JSON object per message and line; what is no finite number is null.
    #[arg(long, conflicts_with = "csv")]
    json: bool,
    /// One line per row: seq, stamp, tick, row, then the row's fields; headers are left out.
    #[arg(long)]
    csv: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let stop = StopFlag::register(exit::DONE)?;
    let run = args.run.find_alive()?;
    let format = match (args.json, args.csv) {
        (true, _) => Format::Json,
        (_, true) => Format::Csv,
        _ => Format::Text,
    };
    let layout = Layout::new(run.topic(&args.topic)?.table.clone(), &args.fields, args.rows, format).map_err(Usage)?;
    let looking = if args.lossless { Looking::Lossless } else { Looking::Dropping };
    let Some(mut tap) = Tap::open(run, &args.topic, looking, stop)? else { return Ok(()) };
    let mut stdout = BufWriter::new(std::io::stdout().lock());
    stdout.write_all(layout.title().as_bytes())?;
    let (mut n_shown, mut n_missed) = (0, 0);
    while args.count.is_none_or(|count| n_shown < count) {
        match tap.next(None)? {
            Some(TapEvent::Message(message, missed)) => {
                n_shown += 1;
                n_missed += missed;
                stdout.write_all(layout.message(&message, missed)?.as_bytes())?;
                // Who reads through a pipe sees each message when it comes.
                stdout.flush()?;
            }
            Some(TapEvent::Restarted(attempt)) => {
                eprintln!("restart {attempt}: the run goes on from its last barrier");
            }
            Some(TapEvent::Ended) => break,
            None => {}
        }
    }
    eprintln!("{n_shown} messages shown, {n_missed} passed by unseen");
    Ok(())
}
