//! `replica record`: records topics of a running pipeline.

mod attachment;
mod progress;

use super::attach::{Run, RunArgument, channels};
use attachment::{Attachment, CompleteTick};
use command_line::say_error;
use command_line::terminal::StopFlag;
use command_line::usage_error::UsageError;
use files::regular_file;
use ipc::{Attached, IpcError, ObserverMode};
use messages::{Message, PlacementTopic};
use progress::Progress;
use recording::RecordingWriter;
use run::exit;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

/// Interval between two polls of empty queues. The shortest tick of a sensor takes 50 ms, and queues hold several messages.
const POLL_INTERVAL: Duration = Duration::from_millis(2);

/// Record topics of a running pipeline into an MCAP file.
///
/// Records until the run ends or Ctrl-C. After a restart of the run, recording continues without gaps or duplicates. A second
/// Ctrl-C ends immediately and leaves a truncated file. With submap or trajectory, placement is recorded too: it moves them to
/// the world frame.
#[derive(clap::Args, Debug)]
#[command(
    override_usage = "replica record [OPTIONS] --topics <TOPICS> [RUN] <FILE>",
    after_help = "Exit codes: 0 the recording is complete, 1 failed, 2 wrong usage, 3 the recording is not complete\n\n\
                  Example: replica record out/sample part.mcap --topics submap,color"
)]
pub struct Args {
    /// Recording to write, replaced if it exists; optionally preceded by the output folder of the run, as after --run
    // One argument: clap distinguishes [RUN] and FILE only if no option is between them.
    #[arg(value_name = "[RUN] FILE", required = true, num_args = 1..=2)]
    paths: Vec<PathBuf>,
    #[command(flatten)]
    run: RunArgument,
    /// Topics, e.g. submap,color
    #[arg(long, value_delimiter = ',', required = true)]
    topics: Vec<String>,
    /// No back-pressure on the run: messages that the disk is too slow for are dropped and counted
    #[arg(long)]
    may_drop: bool,
}

/// The positional arguments.
struct RunAndFile<'a> {
    run: RunArgument,
    /// The recording.
    file: &'a Path,
}

impl Args {
    fn run_and_file(&self) -> Result<RunAndFile<'_>, UsageError> {
        match self.paths.as_slice() {
            [file] => Ok(RunAndFile { run: self.run.clone(), file }),
            [output, file] if self.run.is_default() => Ok(RunAndFile { run: RunArgument::from_output(output), file }),
            [output, _] => {
                Err(UsageError(format!("{} and --run both select the run: give one of them", output.display())))
            }
            more => Err(UsageError(format!("{} paths, must be one or two: [RUN] FILE", more.len()))),
        }
    }
}

/// Why recording ended.
enum End {
    /// The last tick is written.
    Complete,
    /// Ctrl-C.
    Stopped,
    /// The run ended before its last tick.
    RunEnded,
}

/// Records until the run ends or Ctrl-C.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    // A second signal leaves a truncated file.
    let stop = StopFlag::register(exit::INCOMPLETE)?;
    let RunAndFile { run, file } = args.run_and_file()?;
    let run = run.find_alive()?;
    let known: Vec<&str> = run.wiring.topics().map(|(_, topic)| topic.channels.topic.as_str()).collect();
    let names = with_placement(args.topics.clone(), &known);
    let tables: Vec<_> =
        names.iter().map(|name| run.topic(name).map(|topic| topic.table.clone())).collect::<Result<_, _>>()?;
    let about = BTreeMap::from([
        ("mode".to_owned(), format!("{:?}", run.wiring.mode).to_lowercase()),
        (
            "launch_file".to_owned(),
            regular_file::read_to_string(run.output.join("run/launch.toml")).unwrap_or_default(),
        ),
    ]);
    let mut recorder = Recorder {
        writer: RecordingWriter::create(file, &about, &tables)?,
        topics: names.into_iter().map(Progress::new).collect(),
        stop,
        run,
        may_drop: args.may_drop,
    };
    let end = recorder.record();
    let Recorder { writer, topics, .. } = recorder;
    // Whatever happened, the messages so far are a valid recording.
    writer.finish()?;
    for topic in &topics {
        say_error!("{topic}");
    }
    let missing = topics.iter().any(|topic| topic.n_dropped() > 0);
    let complete = match end? {
        End::Complete => !missing,
        End::Stopped => {
            say_error!("stopped: the recording ends before the run");
            false
        }
        End::RunEnded => {
            say_error!("the run ended before the end of its drive");
            false
        }
    };
    Ok(ExitCode::from(if complete { exit::DONE } else { exit::INCOMPLETE }))
}

/// The topics to record, sorted and without duplicates: the same run gives the same file. `known` are the topics of the run.
fn with_placement(mut names: Vec<String>, known: &[&str]) -> Vec<String> {
    let is_moved = |name: &String| PlacementTopic::MOVES.contains(&name.as_str());
    let placement = PlacementTopic::TOPIC;
    if known.contains(&placement) && names.iter().any(is_moved) {
        names.push(placement.to_owned());
    }
    names.sort();
    names.dedup();
    names
}

struct Recorder {
    writer: RecordingWriter,
    topics: Vec<Progress>,
    stop: StopFlag,
    run: Run,
    may_drop: bool,
}

impl Recorder {
    /// Records the attempts of the run one after another. The observers of an attempt are closed before this returns, so that the
    /// run does not wait for them.
    fn record(&mut self) -> anyhow::Result<End> {
        while let Some(mut attached) = self.attach()? {
            if let Some(end) = self.record_attempt(&mut attached)? {
                return Ok(end);
            }
        }
        Ok(if self.stop.is_set() { End::Stopped } else { End::RunEnded })
    }

    fn attach(&mut self) -> anyhow::Result<Option<Attached<Vec<Attachment>>>> {
        let Self { run, topics, stop, may_drop, .. } = self;
        let mode = if *may_drop { ObserverMode::Dropping } else { ObserverMode::Lossless };
        Ok(run.attach(
            |node, wiring| {
                let open = |topic: &Progress| {
                    let channels = channels(wiring, topic.name())?;
                    let opened = Attachment::open(node, channels, mode);
                    // A recorder of the other moved topic may have the lossless slot. Its producer waits for the moved topic, so
                    // nothing is dropped; a gap would end the recording with an error.
                    let is_shared = topic.name() == PlacementTopic::TOPIC && mode == ObserverMode::Lossless;
                    opened.or_else(|error| {
                        if is_shared { Attachment::open(node, channels, ObserverMode::Dropping) } else { Err(error) }
                    })
                };
                topics.iter().map(open).collect()
            },
            || stop.is_set(),
        )?)
    }

    /// Records until the attempt ends. Returns why recording ended, or `None` if another attempt may follow.
    fn record_attempt(&mut self, attached: &mut Attached<Vec<Attachment>>) -> anyhow::Result<Option<End>> {
        let mut ready = false;
        loop {
            let has_ended = self.run.has_ended(attached);
            if self.stop.is_set() && !has_ended {
                return Ok(Some(End::Stopped));
            }
            match self.step(attached, &mut ready) {
                Ok(true) => {}
                Ok(false) if self.topics.iter().all(Progress::ended) => return Ok(Some(End::Complete)),
                Ok(false) if has_ended => return Ok(None),
                Ok(false) => std::thread::sleep(POLL_INTERVAL),
                Err(error) => {
                    self.run.ignore_if_ended(attached, error.downcast::<IpcError>()?)?;
                    return Ok(None);
                }
            }
        }
    }

    /// Connects until all producers know the observers, then receives and writes. `false` if there was nothing to do.
    fn step(&mut self, attachments: &mut [Attachment], ready: &mut bool) -> anyhow::Result<bool> {
        if !*ready {
            *ready = Attachment::connect_all(attachments)?;
            if *ready {
                // For the supervisor, which now starts the sources. If stdout is closed, no process waits for this line.
                let _ = writeln!(std::io::stdout(), "ready {}", self.run.wiring.attempt);
            }
        }
        self.write_complete_ticks(attachments)
    }

    /// Receives messages and writes complete ticks. `false` if there was nothing to do.
    fn write_complete_ticks(&mut self, attachments: &mut [Attachment]) -> anyhow::Result<bool> {
        let mut any = false;
        for (attachment, topic) in attachments.iter_mut().zip(&mut self.topics) {
            any |= attachment.receive(topic, self.may_drop)?;
        }
        if self.may_drop {
            for (attachment, topic) in attachments.iter_mut().zip(&mut self.topics) {
                if let Some(tick) = attachment.take_tick(topic, true)? {
                    write(&mut self.writer, topic.name(), &tick)?;
                    any = true;
                }
            }
            return Ok(any);
        }
        // All topics start with the same tick.
        if let Some(first) = self.topics.iter().map(Progress::next_tick).try_fold(0, |most, tick| Some(most.max(tick?)))
        {
            self.topics.iter_mut().for_each(|topic| topic.start_at(first));
        }
        let all_complete =
            attachments.iter().zip(&self.topics).all(|(attachment, topic)| attachment.has_complete_tick(topic));
        if all_complete && self.topics.iter().any(|topic| !topic.ended()) {
            for (attachment, topic) in attachments.iter_mut().zip(&mut self.topics) {
                if let Some(tick) = attachment.take_tick(topic, false)? {
                    write(&mut self.writer, topic.name(), &tick)?;
                }
            }
            any = true;
        }
        Ok(any)
    }
}

/// Writes one tick of a topic.
fn write(writer: &mut RecordingWriter, topic: &str, tick: &CompleteTick) -> anyhow::Result<()> {
    for message in &tick.messages {
        writer.message(topic, tick.row.drive_time, message.envelope(), message.header(), message.rows())?;
    }
    Ok(writer.tick(topic, &tick.row)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn placement_is_recorded_with_the_topics_that_it_moves() {
        let of = |names: &[&str], known: &[&str]| {
            with_placement(names.iter().map(|name| (*name).to_owned()).collect(), known).join(",")
        };
        let known = ["sweep", "submap", "trajectory", "placement", "color"];
        assert_eq!(of(&["submap", "trajectory", "color"], &known), "color,placement,submap,trajectory");
        assert_eq!(of(&["trajectory"], &known), "placement,trajectory");
        assert_eq!(of(&["submap", "placement", "submap"], &known), "placement,submap");
        assert_eq!(of(&["sweep", "color"], &known), "color,sweep");
        assert_eq!(of(&["submap"], &known[..2]), "submap", "the run has no placement");
    }
}
