//! Publishes sweeps of numbered points.

use stage::messages::{SweepHeader, SweepTopic};
use stage::{Context, Flow, Inputs, Outputs, Port, Stage, StepError, any, decode_state, encode_state, within};
use std::time::Duration;

stage::settings! {
    /// Settings of the source.
    pub struct Settings {
        /// Sweeps, one per tick, a tenth of a second each.
        pub ticks: u64 = 40 => within(1, 1_000_000);
        /// Points of a sweep.
        pub points: usize = 1000 => within(0, 1_000_000);
        /// Pause before each sweep, ms: imitates a sensor.
        pub pace_ms: u64 = 0 => within(0, 1000);
        /// Tick from which the coordinates of the points are NaN.
        pub nan_from: u64 = u64::MAX => any();
    }
}

/// A source whose sweep n consists of points that depend only on n.
pub struct Source {
    settings: Settings,
    next: u64,
}

impl Stage for Source {
    const NAME: &'static str = "source";
    type Settings = Settings;

    fn inputs() -> Vec<Port> {
        Vec::new()
    }

    fn outputs() -> Vec<Port> {
        vec![Port::of::<SweepTopic>()]
    }

    fn new(settings: &Settings, _context: &Context) -> Result<Self, StepError> {
        Ok(Self { settings: settings.clone(), next: 0 })
    }

    fn step(&mut self, _inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError> {
        let n_points = self.settings.points;
        std::thread::sleep(Duration::from_millis(self.settings.pace_ms));
        let mut loan = outputs.loan::<SweepTopic>(n_points)?;
        *loan.header_mut() = SweepHeader { n_rings: 32, ..SweepHeader::default() };
        let rows = loan.grow(n_points)?;
        for (index, row) in rows.iter_mut().enumerate() {
            row.x = if self.next < self.settings.nan_from { self.next as f32 } else { f32::NAN };
            row.offset_nanos = index as u32;
        }
        let stamp = self.next as i64 * 100_000_000;
        outputs.publish(loan, stamp)?;
        outputs.set_drive_time(stamp);
        self.next += 1;
        outputs.set_progress(self.next as f64 / self.settings.ticks as f64);
        Ok(if self.next < self.settings.ticks { Flow::Continue } else { Flow::End })
    }

    fn save(&mut self) -> Result<stage::StateBytes<'_>, StepError> {
        Ok(encode_state(1, &self.next)?.into())
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        self.next = decode_state(1, state)?;
        Ok(())
    }
}
