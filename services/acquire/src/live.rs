//! Publishes the sweeps of a sensor on the network, and what the other sensors of the vehicle send. A restarted process begins the next capture and decodes that one, so its saved
//! state is empty.

use crate::Settings;
use crate::publish::{
    count_all, no_doubts, publish_fixes, publish_image, publish_mosaic, publish_rows, publish_sweep, report_doubts,
};
use crate::sweep;
use acquisition::error::LiveError;
use acquisition::live::{
    Discarded, DueFrame, LiveLimits, LivePoll, LiveSensor, Mounting, OtherLimits, OtherSensors, OtherSources, address,
    bind, captures, folder_inside,
};
use acquisition::recorded::Trigger;
use messages::{ImageTopic, ImuTopic, Message, MosaicTopic, SweepTopic};
use stage::{Context, Flow, Loan, Outputs, Problem, StepError, decode_state, encode_state};
use std::time::{Duration, Instant};

/// Differs from the versions of recorded drives.
const STATE_VERSION: u32 = 1001;
/// Longest time of a step without packets, so that commands are handled.
const STEP_TIMEOUT: Duration = Duration::from_millis(50);
/// With a smaller buffer a stall of the disk soon drops packets: an HDL-32E fills 4 MiB per second, with bookkeeping.
const RECOMMENDED_BUFFER: usize = 4 << 20;

/// The sensor, and what has been published and reported of it.
pub(crate) struct Live {
    settings: Settings,
    sensor: LiveSensor,
    others: OtherSensors,
    /// Points of the current sweep, once it has some.
    loan: Option<Loan<SweepTopic>>,
    n_packets: u64,
}

/// Result of [`Live::advance`].
enum Advance {
    Published,
    Waiting,
    Ended,
}

impl Live {
    /// Settings that prevent receiving or recording.
    pub(crate) fn check(settings: &Settings, context: &Context) -> Vec<Problem> {
        let problem = |error: &LiveError| Problem::of_key(error.key(), error.to_string());
        let mut problems = Vec::new();
        for (key, value) in [("start_s", settings.start_s), ("end_s", settings.end_s)] {
            if value != 0.0 {
                let text = format!("value {value} is for recorded drives; must be 0 in live mode");
                problems.push(Problem::of_key(key, text));
            }
        }
        let mut bound = Vec::new();
        for (key, value) in [("listen", &settings.listen), ("position_listen", &settings.position_listen)] {
            match address(value).and_then(bind) {
                Ok(socket) => bound.push(socket),
                Err(error) => problems.push(Problem::of_key(key, error.to_string())),
            }
        }
        problems.extend(Mounting::find(&context.drive, &settings.model).err().as_ref().map(problem));
        let sources = sources(settings, context).map(|sources| sources.check());
        problems.extend(
            sources
                .unwrap_or_else(|errors| errors)
                .iter()
                .map(problem)
                .filter(|other| !problems.contains(other))
                .collect::<Vec<_>>(),
        );
        let folder = match folder_inside(&context.output, &settings.recording) {
            Ok(folder) => folder,
            Err(error) => {
                problems.push(problem(&error));
                return problems;
            }
        };
        match captures(&folder) {
            Ok(captures) if captures.is_empty() => {}
            Ok(captures) => problems.push(problem(&LiveError::Used { n: captures.len(), folder })),
            Err(error) => problems.push(Problem::of_key("recording", format!("{}: {error}", folder.display()))),
        }
        problems
    }

    /// Starts the recording.
    pub(crate) fn open(settings: &Settings, context: &Context) -> Result<Self, StepError> {
        let Settings { min_turn, quiet_s, max_undecoded_s, max_behind, .. } = *settings;
        let limits = LiveLimits { min_turn, quiet_s, max_undecoded_s, max_behind };
        let other_limits =
            OtherLimits { max_late_s: settings.max_late_s, max_clock_offset_s: settings.max_clock_offset_ms * 1e-3 };
        let start = || -> Result<(LiveSensor, OtherSensors), LiveError> {
            let addresses = [address(&settings.listen)?, address(&settings.position_listen)?];
            let mounting = Mounting::find(&context.drive, &settings.model)?;
            let folder = folder_inside(&context.output, &settings.recording)?;
            let sources = sources(settings, context).map_err(|mut errors| errors.swap_remove(0))?;
            let trigger = Trigger::new(settings.trigger_hz, settings.trigger_m);
            let others = OtherSensors::start(&sources, folder.clone(), other_limits, trigger)?;
            let mounting = mounting.with_others(others.entries());
            Ok((LiveSensor::start(addresses, folder, mounting, limits)?, others))
        };
        let (sensor, others) = start().map_err(step_error)?;
        Ok(Self { settings: settings.clone(), sensor, others, loan: None, n_packets: 0 })
    }

    /// Publishes the next sweep and one image that is due; nothing if there is none within [`STEP_TIMEOUT`]. One image at a time, so that
    /// the LiDAR never waits for more than one.
    pub(crate) fn step(&mut self, outputs: &mut Outputs) -> Result<Flow, StepError> {
        let until = Instant::now() + STEP_TIMEOUT;
        let flow = loop {
            self.sensor.check_receiver().map_err(step_error)?;
            let advance = self.advance(outputs)?;
            if matches!(advance, Advance::Waiting) {
                self.sensor.check_decoded().map_err(step_error)?;
            }
            let has_published = self.publish_rows(outputs)? | self.publish_frame(outputs)?;
            match advance {
                Advance::Waiting if !has_published && self.sensor.wait(until) => {}
                Advance::Ended if !has_published => break Flow::End,
                Advance::Published | Advance::Waiting | Advance::Ended => break Flow::Continue,
            }
        };
        self.others.write_clocks(false).map_err(step_error)?;
        self.report_counts(outputs);
        Ok(flow)
    }

    /// Publishes fixes and inertial samples of the time up to the last sweep. `false` if there are none.
    fn publish_rows(&mut self, outputs: &mut Outputs) -> Result<bool, StepError> {
        let due = self.others.take_rows().map_err(step_error)?;
        let n_rows = publish_fixes(&due.fixes, outputs)?;
        self.others.add_fixes(due.fixes.len() as u64, n_rows);
        publish_rows::<ImuTopic>(&due.samples, due.samples.first().map(|row| row.stamp), outputs)?;
        Ok(n_rows > 0 || !due.samples.is_empty())
    }

    /// Publishes the oldest image of the time up to the last sweep. `false` if there is none.
    fn publish_frame(&mut self, outputs: &mut Outputs) -> Result<bool, StepError> {
        let Some(due) = self.others.next_frame() else { return Ok(false) };
        let (cameras, mosaics) = self.others.cameras();
        let error = match &due {
            DueFrame::Color(frame) => publish_image(frame, &cameras[frame.camera], outputs)?,
            DueFrame::Mosaic(frame) => publish_mosaic(frame, &mosaics[frame.camera], outputs)?,
        };
        self.others.add_published(&due, error);
        Ok(true)
    }

    /// Ends the recording and publishes its last sweeps, as many as fit into a tick; the others are counted.
    pub(crate) fn finish(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        self.sensor.close();
        self.others.close();
        // The tick may already have one sweep, and one image of any kind.
        for _ in 1..SweepTopic::QUEUE {
            if !matches!(self.advance(outputs)?, Advance::Published) {
                break;
            }
        }
        self.publish_rows(outputs)?;
        for _ in 1..ImageTopic::QUEUE.min(MosaicTopic::QUEUE) {
            if !self.publish_frame(outputs)? {
                break;
            }
        }
        self.loan = None;
        self.sensor.discard_rest().map_err(step_error)?;
        self.others.discard_rest();
        self.others.write_clocks(true).map_err(step_error)?;
        self.report_counts(outputs);
        self.others.clock_notes().into_iter().for_each(|text| outputs.note(text));
        self.report_doubts(outputs);
        Ok(())
    }

    fn report_doubts(&self, outputs: &mut Outputs) {
        if self.sensor.n_sweeps() == 0 && self.n_packets > 0 {
            let text = format!("{} packets were received and recorded, none of them gave a sweep", self.n_packets);
            outputs.doubt("no_sweep", self.n_packets as f64, text);
        }
        if let Some((lidar, log)) = self.sensor.stats() {
            let mut doubts = no_doubts(&self.settings);
            doubts.captures(&lidar, self.sensor.recorded_bytes());
            self.others.doubt(&lidar, log, &mut doubts);
            report_doubts(doubts, outputs);
        }
    }

    pub(crate) fn save() -> Result<Vec<u8>, StepError> {
        Ok(encode_state(STATE_VERSION, &())?)
    }

    pub(crate) fn load(state: &[u8]) -> Result<(), StepError> {
        Ok(decode_state(STATE_VERSION, state)?)
    }

    /// Reads the capture until a sweep is complete or the capture ends.
    fn advance(&mut self, outputs: &mut Outputs) -> Result<Advance, StepError> {
        loop {
            let mut loan = match self.loan.take() {
                Some(loan) => loan,
                None => sweep::loan(outputs)?,
            };
            match sweep::fill(&mut loan, |sink| self.sensor.poll(sink).map_err(step_error))? {
                LivePoll::Sweep(info, n_rings, fixes) => {
                    publish_sweep(loan, &info, n_rings, outputs)?;
                    self.others.add_sweep(&info, self.sensor.take_arrival());
                    if !self.others.has_receiver() {
                        self.others.add_packet_fixes(&fixes);
                        let n_rows = publish_fixes(&fixes, outputs)?;
                        self.others.add_fixes(fixes.len() as u64, n_rows);
                    }
                    outputs.set_drive_time(info.stamp.0);
                    return Ok(Advance::Published);
                }
                LivePoll::Discarded => {}
                LivePoll::NoSensor(error) => {
                    outputs.note(format!("{error}; packets are recorded but not decoded"));
                }
                LivePoll::Waiting => {
                    self.loan = Some(loan);
                    return Ok(Advance::Waiting);
                }
                LivePoll::Ended => return Ok(Advance::Ended),
            }
        }
    }

    /// Updates the counters of the run summary.
    fn report_counts(&mut self, outputs: &mut Outputs) {
        let n_packets = self.sensor.n_packets();
        if self.n_packets == 0 && n_packets > 0 {
            self.note_begin(outputs);
        }
        let Discarded { skipped, partial } = self.sensor.take_discarded();
        let counters = [
            ("udp_packets", n_packets - self.n_packets),
            ("udp_packets_dropped", self.sensor.take_dropped()),
            ("sweeps_skipped", skipped),
            ("partial_sweeps", partial),
        ];
        count_all(counters, outputs);
        self.n_packets = n_packets;
        let (counters, notes) = self.others.take_news(self.sensor.stats());
        count_all(counters, outputs);
        for text in notes {
            outputs.note(text);
        }
    }

    fn note_begin(&self, outputs: &mut Outputs) {
        outputs.note(format!("recording to {}", self.sensor.capture().display()));
        outputs.note(self.sensor.rig().to_string());
        let n_bytes = self.sensor.buffer_bytes();
        if n_bytes < RECOMMENDED_BUFFER {
            outputs.note(format!(
                "the kernel's receive buffer has {n_bytes} bytes; set net.core.rmem_max to {RECOMMENDED_BUFFER} to avoid dropped packets \
                 when the disk stalls"
            ));
        }
    }
}

/// The sensors beside the LiDAR.
fn sources(settings: &Settings, context: &Context) -> Result<OtherSources, Vec<LiveError>> {
    let Settings { cameras, gnss, imu, .. } = settings;
    let cameras = (!cameras.is_empty()).then(|| context.launch_folder.join(cameras));
    OtherSources::find(cameras, gnss, imu, &context.drive)
}

fn step_error(error: LiveError) -> StepError {
    if error.is_of_files() { StepError::io(error) } else { StepError::data(error) }
}
