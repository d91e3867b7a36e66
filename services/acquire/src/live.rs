//! Publishes the sweeps of a sensor on the network. A restarted process begins the next capture and decodes that one, so its saved
//! state is empty.

use crate::Settings;
use crate::publish::{no_doubts, publish_fixes, publish_other, publish_sweep, report_doubts};
use crate::sweep;
use acquisition::counters::ReportedCounts;
use acquisition::error::LiveError;
use acquisition::live::{Discarded, LiveLimits, LiveOther, LivePoll, LiveSensor, LiveSetup};
use formats::drive::SweepInfo;
use messages::{Message, SweepTopic};
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
    /// The LiDARs after the first.
    others: Vec<LiveOther>,
    /// Points of the current sweep, once it has some.
    loan: Option<Loan<SweepTopic>>,
    reported: ReportedCounts,
    n_packets: u64,
    gnss_rows: u64,
    n_fixes: u64,
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
        let mut problems = Vec::new();
        for (key, value) in [("start_s", settings.start_s), ("end_s", settings.end_s)] {
            if value != 0.0 {
                let text = format!("value {value} is for recorded drives; must be 0 in live mode");
                problems.push(Problem::of_key(key, text));
            }
        }
        problems.extend(setup(settings, context).problems().into_iter().map(|(key, text)| Problem::of_key(key, text)));
        problems
    }

    /// Starts the recording.
    pub(crate) fn open(settings: &Settings, context: &Context) -> Result<Self, StepError> {
        let Settings { min_turn, quiet_s, max_undecoded_s, max_behind, .. } = *settings;
        let limits = LiveLimits { min_turn, quiet_s, max_undecoded_s, max_behind };
        let (sensor, others) = setup(settings, context).start(limits).map_err(step_error)?;
        Ok(Self {
            settings: settings.clone(),
            sensor,
            others,
            loan: None,
            reported: ReportedCounts::default(),
            n_packets: 0,
            gnss_rows: 0,
            n_fixes: 0,
        })
    }

    /// Publishes the next sweep, or nothing if none is complete within [`STEP_TIMEOUT`].
    pub(crate) fn step(&mut self, outputs: &mut Outputs) -> Result<Flow, StepError> {
        let until = Instant::now() + STEP_TIMEOUT;
        let flow = loop {
            self.sensor.check_receiver().map_err(step_error)?;
            let advance = self.advance(outputs)?;
            if matches!(advance, Advance::Waiting) {
                self.sensor.check_decoded().map_err(step_error)?;
            }
            match advance {
                Advance::Waiting if self.sensor.wait(until) => {}
                Advance::Published | Advance::Waiting => break Flow::Continue,
                Advance::Ended => break Flow::End,
            }
        };
        self.report_counts(outputs);
        Ok(flow)
    }

    /// Ends the recording and publishes its last sweeps, as many as fit into a tick; the others are counted.
    pub(crate) fn finish(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        self.sensor.close();
        self.others.iter_mut().for_each(LiveOther::close);
        // The tick may already have one sweep of each LiDAR.
        for _ in 1..SweepTopic::QUEUE / (1 + self.others.len()) {
            if !matches!(self.advance(outputs)?, Advance::Published) {
                break;
            }
        }
        self.loan = None;
        self.sensor.discard_rest().map_err(step_error)?;
        self.report_counts(outputs);
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
            doubts.log(&log, self.gnss_rows, self.n_fixes);
            self.others.iter().for_each(|other| other.doubt(&mut doubts));
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
                    self.publish_others(&info, outputs)?;
                    self.n_fixes += fixes.len() as u64;
                    self.gnss_rows += publish_fixes(&fixes, outputs)?;
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

    /// Publishes the points of the other LiDARs during the sweep.
    fn publish_others(&mut self, info: &SweepInfo, outputs: &mut Outputs) -> Result<(), StepError> {
        for other in &mut self.others {
            let mut loan = sweep::loan(outputs)?;
            let found = sweep::fill(&mut loan, |sink| other.next_sweep(info, sink).map_err(step_error))?;
            publish_other(loan, found, outputs)?;
        }
        Ok(())
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
        outputs.count_all(counters);
        self.others.iter_mut().for_each(|other| outputs.count_all(other.take_counts()));
        self.n_packets = n_packets;
        if let Some((lidar, log)) = self.sensor.stats() {
            outputs.count_all(self.reported.take_new(lidar, log));
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

fn setup<'a>(settings: &'a Settings, context: &'a Context) -> LiveSetup<'a> {
    let Settings { listen, position_listen, model, recording, .. } = settings;
    LiveSetup { listen, position_listen, model, recording, drive: &context.drive, output: &context.output }
}

fn step_error(error: LiveError) -> StepError {
    if error.is_of_files() { StepError::io(error) } else { StepError::data(error) }
}
