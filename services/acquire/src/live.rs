//! Publishes the sweeps of the LiDARs on the network, and the data of the vehicle's other sensors. A restarted process
//! starts the next capture and decodes that one, so its saved state is empty.

use crate::Settings;
use crate::publish::{
    no_doubts, publish_fixes, publish_image, publish_mosaic, publish_secondary, publish_sweep, report, report_doubts,
};
use crate::sweep;
use acquisition::error::LiveError;
use acquisition::live::{AuxiliaryLimits, DueFrame, LiveLimits, LivePlan, LivePoll, LiveVehicle};
use acquisition::recorded::Trigger;
use messages::{ImageTopic, ImuTopic, Message, MosaicTopic, SweepTopic};
use stage::{Context, Flow, Loan, Outputs, Problem, StepError, decode_state, encode_state};
use std::time::{Duration, Instant};

/// Differs from the versions of recorded drives.
const STATE_VERSION: u32 = 1001;
/// Longest time of a step without packets, so that commands are handled.
const STEP_TIMEOUT: Duration = Duration::from_millis(50);

/// The vehicle, and its published data.
pub(crate) struct Live {
    settings: Settings,
    vehicle: LiveVehicle,
    /// Points of the current sweep, once it has points.
    loan: Option<Loan<SweepTopic>>,
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
                problems.push(Problem::for_key(key, text));
            }
        }
        problems.extend(plan(settings, context).problems().into_iter().map(|(key, text)| Problem::for_key(key, text)));
        problems
    }

    /// Starts the recording.
    pub(crate) fn open(settings: &Settings, context: &Context) -> Result<Self, StepError> {
        let vehicle = plan(settings, context).start().map_err(step_error)?;
        Ok(Self { settings: settings.clone(), vehicle, loan: None })
    }

    /// Publishes the next sweep and one due image; nothing if no sweep is complete within [`STEP_TIMEOUT`]. One image
    /// at a time, so that the LiDAR never waits for more than one.
    pub(crate) fn step(&mut self, outputs: &mut Outputs) -> Result<Flow, StepError> {
        let until = Instant::now() + STEP_TIMEOUT;
        let flow = loop {
            self.vehicle.lidar.check_receiver().map_err(step_error)?;
            let advance = self.advance(outputs)?;
            if matches!(advance, Advance::Waiting) {
                self.vehicle.lidar.check_decoded().map_err(step_error)?;
            }
            let has_published = self.publish_rows(outputs)? | self.publish_frame(outputs)?;
            match advance {
                Advance::Waiting if !has_published && self.vehicle.lidar.wait(until) => {}
                Advance::Ended if !has_published => break Flow::End,
                Advance::Published | Advance::Waiting | Advance::Ended => break Flow::Continue,
            }
        };
        self.vehicle.auxiliary.write_clocks(false).map_err(step_error)?;
        report(self.vehicle.take_news(), outputs);
        Ok(flow)
    }

    /// Publishes fixes and inertial samples up to the last sweep. `false` without any.
    fn publish_rows(&mut self, outputs: &mut Outputs) -> Result<bool, StepError> {
        let auxiliary = &mut self.vehicle.auxiliary;
        let due = auxiliary.take_rows().map_err(step_error)?;
        let n_rows = publish_fixes(&due.fixes, outputs)?;
        auxiliary.add_fixes(due.fixes.len() as u64, n_rows);
        outputs.publish_rows::<ImuTopic>(&due.samples, |row| row.stamp)?;
        Ok(n_rows > 0 || !due.samples.is_empty())
    }

    /// Publishes the oldest image up to the last sweep. `false` without an image.
    fn publish_frame(&mut self, outputs: &mut Outputs) -> Result<bool, StepError> {
        let auxiliary = &mut self.vehicle.auxiliary;
        let Some(due) = auxiliary.next_frame() else { return Ok(false) };
        let error = match &due {
            DueFrame::Color(frame) => publish_image(frame, &auxiliary.cameras()[frame.camera], outputs)?,
            DueFrame::Mosaic(frame) => publish_mosaic(frame, &auxiliary.mosaics()[frame.camera], outputs)?,
        };
        auxiliary.add_published(&due, error);
        Ok(true)
    }

    /// Ends the recording and publishes its last sweeps, up to the limits of one tick; the others are counted.
    pub(crate) fn finish(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        self.vehicle.close();
        // The tick may already have one sweep of each LiDAR, and one image of any kind.
        for _ in 1..SweepTopic::QUEUE / self.vehicle.n_lidars() {
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
        self.vehicle.discard_rest().map_err(step_error)?;
        report(self.vehicle.take_news(), outputs);
        self.vehicle.auxiliary.clock_notes().into_iter().for_each(|text| outputs.note(text));
        let mut doubts = no_doubts(&self.settings);
        self.vehicle.doubt(&mut doubts);
        report_doubts(doubts, outputs);
        Ok(())
    }

    pub(crate) fn save() -> Result<Vec<u8>, StepError> {
        Ok(encode_state(STATE_VERSION, &())?)
    }

    pub(crate) fn load(state: &[u8]) -> Result<(), StepError> {
        Ok(decode_state(STATE_VERSION, state)?)
    }

    /// Reads the capture until a sweep is complete or the capture ends.
    fn advance(&mut self, outputs: &mut Outputs) -> Result<Advance, StepError> {
        let vehicle = &mut self.vehicle;
        loop {
            let mut loan = match self.loan.take() {
                Some(loan) => loan,
                None => sweep::loan(outputs)?,
            };
            match sweep::fill(&mut loan, |sink| vehicle.lidar.poll(sink).map_err(step_error))? {
                LivePoll::Sweep(info, n_rings, fixes) => {
                    publish_sweep(loan, &info, n_rings, outputs)?;
                    for lidar in &mut vehicle.secondary_lidars {
                        publish_secondary(|sink| lidar.next_sweep(&info, sink).map_err(step_error), outputs)?;
                    }
                    vehicle.add_sweep(&info);
                    let auxiliary = &mut vehicle.auxiliary;
                    if !auxiliary.has_receiver() {
                        auxiliary.add_packet_fixes(&fixes);
                        let n_rows = publish_fixes(&fixes, outputs)?;
                        auxiliary.add_fixes(fixes.len() as u64, n_rows);
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
}

/// The sensors according to the settings.
fn plan<'a>(settings: &'a Settings, context: &'a Context) -> LivePlan<'a> {
    let Settings { min_turn, quiet_s, max_undecoded_s, max_behind, max_late_s, .. } = *settings;
    let cameras = Some(&settings.cameras).filter(|folder| !folder.is_empty());
    LivePlan {
        drive: &context.drive,
        output: &context.output,
        recording: &settings.recording,
        listen: &settings.listen,
        position_listen: &settings.position_listen,
        model: &settings.model,
        cameras: cameras.map(|folder| context.launch_folder.join(folder)),
        gnss: &settings.gnss,
        imu: &settings.imu,
        limits: LiveLimits { min_turn, quiet_s, max_undecoded_s, max_behind },
        auxiliary_limits: AuxiliaryLimits { max_late_s, max_clock_offset_s: settings.max_clock_offset_ms * 1e-3 },
        trigger: Trigger::new(settings.trigger_hz, settings.trigger_m),
    }
}

fn step_error(error: LiveError) -> StepError {
    match error {
        // A restart does not help: the sensor is off, or sends elsewhere.
        LiveError::Silent { .. } => StepError::configuration(error),
        _ if error.is_of_files() => StepError::io(error),
        _ => StepError::data(error),
    }
}
