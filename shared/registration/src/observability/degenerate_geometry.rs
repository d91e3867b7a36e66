//! Reports stretches of the drive with degenerate geometry to the operator.

use crate::{PredictionSources, Registered};
use serde::{Deserialize, Serialize};

/// Stretches with fewer sweeps are counted but not reported.
const MIN_SWEEPS: u32 = 3;
/// Largest number of stretches that are reported one by one.
const MAX_REPORTED: u32 = 20;

/// Collects stretches of sweeps with degenerate directions or without a match. Serializing it saves the state.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DegenerateStretches {
    /// First shot of the drive, ns.
    begin: Option<i64>,
    /// Standard deviation of the last position, m.
    sigma_m: f64,
    open: Option<Stretch>,
    n_reported: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Stretch {
    begin: i64,
    end: i64,
    n_sweeps: u32,
    n_bridged: u32,
    max_directions: u32,
    /// Sweeps predicted from inertial samples, and sweeps predicted from GNSS velocities.
    n_inertial: u32,
    n_receiver: u32,
    /// Standard deviation of the position before the stretch and at its end, m.
    sigma_m: [f64; 2],
}

/// The relevant data of a sweep.
#[derive(Clone, Copy)]
struct Step {
    begin: i64,
    end: i64,
    /// Degenerate directions; `None` without a match.
    n_degenerate: Option<u32>,
    sources: PredictionSources,
    sigma_m: f64,
}

impl DegenerateStretches {
    /// Adds the next sweep. Returns a report if the sweep ends a stretch.
    pub fn add(&mut self, registered: &Registered) -> Option<String> {
        self.add_sweep(Step {
            begin: registered.stamp.0,
            end: registered.end_stamp().0,
            n_degenerate: registered.matched.as_ref().map(|matched| matched.n_degenerate_directions),
            sources: registered.predicted_by,
            sigma_m: registered.covariance.fixed_view::<3, 3>(0, 0).trace().sqrt(),
        })
    }

    /// Ends the drive. Returns a report on the stretch at its end.
    pub fn finish(&mut self) -> Option<String> {
        let stretch = self.open.take()?;
        self.report(&stretch)
    }

    fn add_sweep(&mut self, step: Step) -> Option<String> {
        let Step { begin, end, n_degenerate, sources, sigma_m } = step;
        self.begin.get_or_insert(begin);
        let before_m = std::mem::replace(&mut self.sigma_m, sigma_m);
        if n_degenerate == Some(0) {
            return self.finish();
        }
        let empty = Stretch {
            begin,
            end,
            n_sweeps: 0,
            n_bridged: 0,
            max_directions: 0,
            n_inertial: 0,
            n_receiver: 0,
            sigma_m: [before_m; 2],
        };
        let stretch = self.open.get_or_insert(empty);
        stretch.end = end;
        stretch.n_sweeps += 1;
        stretch.n_bridged += u32::from(n_degenerate.is_none());
        stretch.max_directions = stretch.max_directions.max(n_degenerate.unwrap_or(6));
        stretch.n_inertial += u32::from(sources.inertial);
        stretch.n_receiver += u32::from(sources.receiver);
        stretch.sigma_m[1] = sigma_m;
        None
    }

    fn report(&mut self, stretch: &Stretch) -> Option<String> {
        if stretch.n_sweeps < MIN_SWEEPS || self.n_reported > MAX_REPORTED {
            return None;
        }
        self.n_reported += 1;
        if self.n_reported > MAX_REPORTED {
            return Some(
                "more degenerate stretches follow: see the counters degenerate_sweeps and sweeps_bridged".to_owned(),
            );
        }
        let seconds = |stamp: i64| (stamp - self.begin.unwrap_or(stamp)) as f64 * 1e-9;
        let begin = seconds(stretch.begin);
        let end = seconds(stretch.end);
        let Stretch { n_sweeps, n_bridged, max_directions, sigma_m: [before_m, after_m], .. } = stretch;
        Some(format!(
            "degenerate geometry from {begin:.1} to {end:.1} s of the drive: {n_sweeps} sweeps, {n_bridged} without a match, up to \
             {max_directions} of 6 directions predicted by {}; standard deviation of the position {before_m:.2} m before, \
             {after_m:.2} m after",
            stretch.sources()
        ))
    }
}

impl Stretch {
    fn sources(&self) -> String {
        match (self.n_inertial, self.n_receiver) {
            (0, 0) => "constant motion".to_owned(),
            (n, 0) => format!("inertial samples ({n} sweeps)"),
            (0, n) => format!("GNSS velocities ({n} sweeps)"),
            (n, m) => format!("inertial samples ({n} sweeps) and GNSS velocities ({m})"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SWEEP_NANOS: i64 = 100_000_000;

    fn reports_with(sources: PredictionSources, sweeps: &[Option<u32>]) -> Vec<String> {
        let mut stretches = DegenerateStretches::default();
        let add = |(number, n_degenerate): (usize, &Option<u32>)| {
            let begin = 5_000_000_000 + number as i64 * SWEEP_NANOS;
            let sigma_m = 0.1 * number as f64;
            stretches.add_sweep(Step { begin, end: begin + SWEEP_NANOS, n_degenerate: *n_degenerate, sources, sigma_m })
        };
        let mut reports: Vec<String> = sweeps.iter().enumerate().filter_map(add).collect();
        reports.extend(stretches.finish());
        reports
    }

    fn reports(sweeps: &[Option<u32>]) -> Vec<String> {
        reports_with(PredictionSources::default(), sweeps)
    }

    #[test]
    fn stretch_is_reported_once_with_its_times() {
        let determined = Some(0);
        let degenerate = Some(2);
        let bridged = None;
        let sweeps = [
            [determined, determined, degenerate, degenerate, bridged, determined],
            [degenerate, degenerate, determined, degenerate, degenerate, degenerate],
        ];
        let reports = reports(sweeps.as_flattened());
        assert_eq!(reports.len(), 2, "two sweeps are not a stretch: {reports:?}");
        assert!(
            reports[0].contains("from 0.2 to 0.5 s") && reports[0].contains("3 sweeps, 1 without"),
            "{}",
            reports[0]
        );
        assert!(reports[0].contains("up to 6 of 6 directions predicted by constant motion"), "{}", reports[0]);
        assert!(reports[0].contains("0.10 m before, 0.40 m after"), "{}", reports[0]);
        assert!(reports[1].contains("from 0.9 to 1.2 s") && reports[1].contains("up to 2 of 6"), "{}", reports[1]);
    }

    #[test]
    fn report_names_the_sensors_of_the_prediction() {
        let report = |inertial: bool, receiver: bool| {
            reports_with(PredictionSources { inertial, receiver }, &[Some(1); 4]).concat()
        };
        assert!(report(true, false).contains("predicted by inertial samples (4 sweeps);"));
        assert!(report(false, true).contains("predicted by GNSS velocities (4 sweeps);"));
        assert!(report(true, true).contains("predicted by inertial samples (4 sweeps) and GNSS velocities (4);"));
    }

    #[test]
    fn reports_of_a_drive_are_limited() {
        let stretch = [Some(1), Some(1), Some(1), Some(0)];
        let reports = reports(&stretch.repeat(100));
        assert_eq!(reports.len() as u32, MAX_REPORTED + 1);
        assert!(reports[MAX_REPORTED as usize].starts_with("more"));
    }
}
