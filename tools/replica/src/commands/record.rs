//! `replica record`: topics of a running pipeline into a recording.

mod attachment;

use crate::attach::{Run, RunArgument, Usage, channels};
use crate::terminal::StopFlag;
use attachment::{Attachment, Progress, Taken};
use formats::recording::RecordingWriter;
use ipc::{IpcError, Looking, Visit};
use stage::exit;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

/// Between two looks at queues that were empty. The shortest tick of a sensor is 50 ms, and queues have several places.
const LOOK: Duration = Duration::from_millis(2);

/// Records topics of a running pipeline into an MCAP file, until the run ends or Ctrl-C. Across restarts it goes on where
/// it was. Exit code 3: not complete.
#[derive(clap::Args, Debug)]
#[command(override_usage = "replica record [OPTIONS] --topics <TOPICS> [RUN] <FILE>")]
pub struct Args {
    /// The recording, which is written anew; before it the output folder of the run, as after --run.
    // One argument, because clap tells [RUN] from FILE only if no option stands between them.
    #[arg(value_name = "[RUN] FILE", required = true, num_args = 1..=2)]
    paths: Vec<PathBuf>,
    #[command(flatten)]
    run: RunArgument,
    /// Topics, e.g. submap,color.
    #[arg(long, value_delimiter = ',', required = true)]
    topics: Vec<String>,
    /// Never hold up the run: what the disk is too slow for is dropped and counted.
    #[arg(long)]
    may_drop: bool,
}

impl Args {
    /// Which run, and the recording.
    fn run_and_file(&self) -> Result<(RunArgument, &Path), Usage> {
        match self.paths.as_slice() {
            [file] => Ok((self.run.clone(), file)),
            [output, file] if self.run.is_default() => Ok((RunArgument::of(output), file)),
            [output, _] => Err(Usage(format!("{} and --run both say which run", output.display()))),
            more => Err(Usage(format!("{} paths: RUN and FILE are two", more.len()))),
        }
    }
}

/// Why looking on came to its end.
enum Over {
    /// The last tick is written.
    Ended,
    /// Ctrl-C.
    Stopped,
    /// The run is over, without its last tick.
    CutShort,
}

/// Records until there is nothing more to come.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    // A second signal leaves a file that is cut.
    let stop = StopFlag::register(exit::INCOMPLETE)?;
    let (run, file) = args.run_and_file()?;
    let run = run.find_alive()?;
    let mut names = args.topics.clone();
    // The order of topics within a tick, so that the same run gives the same file.
    names.sort();
    names.dedup();
    let tables: Vec<_> =
        names.iter().map(|name| run.topic(name).map(|topic| topic.table.clone())).collect::<Result<_, _>>()?;
    let about = BTreeMap::from([
        ("mode".to_owned(), format!("{:?}", run.wiring.mode).to_lowercase()),
        ("launch_file".to_owned(), std::fs::read_to_string(run.output.join("run/launch.toml")).unwrap_or_default()),
    ]);
    let mut recorder = Recorder {
        writer: RecordingWriter::create(file, &about, &tables)?,
        topics: names.into_iter().map(Progress::new).collect(),
        stop,
        run,
        may_drop: args.may_drop,
    };
    let over = recorder.record();
    let Recorder { writer, topics, .. } = recorder;
    // Whatever happened, what has come is a recording.
    writer.finish()?;
    for topic in &topics {
        eprintln!("{topic}");
    }
    let missing = topics.iter().any(|topic| topic.n_dropped() > 0);
    let complete = match over? {
        Over::Ended => !missing,
        Over::Stopped => {
            eprintln!("stopped: the recording ends before its run");
            false
        }
        Over::CutShort => {
            eprintln!("the run ended before its drive did");
            false
        }
    };
    Ok(ExitCode::from(if complete { exit::DONE } else { exit::INCOMPLETE }))
}

struct Recorder {
    writer: RecordingWriter,
    topics: Vec<Progress>,
    stop: StopFlag,
    run: Run,
    may_drop: bool,
}

impl Recorder {
    /// Looks on at one attempt of the run after the other. What was opened in one is left before this returns, so that the
    /// run does not wait for who takes nothing any more.
    fn record(&mut self) -> anyhow::Result<Over> {
        while let Some(mut visit) = self.attach()? {
            if let Some(over) = self.look_on(&mut visit)? {
                return Ok(over);
            }
        }
        Ok(if self.stop.is_set() { Over::Stopped } else { Over::CutShort })
    }

    fn attach(&mut self) -> anyhow::Result<Option<Visit<Vec<Attachment>>>> {
        let Self { run, topics, stop, may_drop, .. } = self;
        let looking = if *may_drop { Looking::Dropping } else { Looking::Lossless };
        run.visit(
            |node, wiring| {
                let open = |topic: &Progress| Attachment::open(node, channels(wiring, topic.name())?, looking);
                topics.iter().map(open).collect()
            },
            || stop.is_set(),
        )
    }

    /// Records until the attempt is over; why this was the last one, if that is known.
    fn look_on(&mut self, visit: &mut Visit<Vec<Attachment>>) -> anyhow::Result<Option<Over>> {
        let mut ready = false;
        loop {
            let over = self.run.is_over(visit);
            if self.stop.is_set() && !over {
                return Ok(Some(Over::Stopped));
            }
            match self.step(visit, &mut ready) {
                Ok(true) => {}
                Ok(false) if self.topics.iter().all(Progress::ended) => return Ok(Some(Over::Ended)),
                Ok(false) if over => return Ok(None),
                Ok(false) => std::thread::sleep(LOOK),
                Err(error) => {
                    self.run.excuse(visit, error.downcast::<IpcError>()?)?;
                    return Ok(None);
                }
            }
        }
    }

    /// Connects as long as not everybody knows of us, then takes what has come. `false`: there was nothing.
    fn step(&mut self, attachments: &mut [Attachment], ready: &mut bool) -> anyhow::Result<bool> {
        if !*ready {
            *ready = Attachment::connect_all(attachments)?;
            if *ready {
                // For the supervisor, which lets sources begin now. If nobody listens any more, nobody waits.
                let _ = writeln!(std::io::stdout(), "ready {}", self.run.wiring.attempt);
            }
        }
        self.take(attachments)
    }

    /// Takes what has come and writes what is whole. `false`: there was nothing.
    fn take(&mut self, attachments: &mut [Attachment]) -> anyhow::Result<bool> {
        let mut anything = false;
        for (attachment, topic) in attachments.iter_mut().zip(&mut self.topics) {
            anything |= attachment.gather(topic, self.may_drop)?;
        }
        if self.may_drop {
            for (attachment, topic) in attachments.iter_mut().zip(&mut self.topics) {
                if let Some(taken) = attachment.take_tick(topic, true)? {
                    write(&mut self.writer, topic.name(), &taken)?;
                    anything = true;
                }
            }
            return Ok(anything);
        }
        // All topics begin with the same tick.
        if let Some(first) = self.topics.iter().map(Progress::next_tick).try_fold(0, |most, tick| Some(most.max(tick?)))
        {
            self.topics.iter_mut().for_each(|topic| topic.begin_at(first));
        }
        let whole = attachments.iter().zip(&self.topics).all(|(attachment, topic)| attachment.is_whole(topic));
        if whole && self.topics.iter().any(|topic| !topic.ended()) {
            for (attachment, topic) in attachments.iter_mut().zip(&mut self.topics) {
                if let Some(taken) = attachment.take_tick(topic, false)? {
                    write(&mut self.writer, topic.name(), &taken)?;
                }
            }
            anything = true;
        }
        Ok(anything)
    }
}

/// Writes one tick of a topic.
fn write(writer: &mut RecordingWriter, topic: &str, taken: &Taken) -> anyhow::Result<()> {
    for message in &taken.messages {
        writer.message(topic, taken.row.drive_time, message.envelope(), message.header(), message.rows())?;
    }
    Ok(writer.tick(topic, &taken.row)?)
}
