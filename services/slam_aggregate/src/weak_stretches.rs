//! Where the scene did not determine the way, for the operator.

use registration::{Lean, Registered};
use serde::{Deserialize, Serialize};

/// Shorter stretches are counted but not told, sweeps.
const MIN_SWEEPS: u32 = 3;
/// Stretches that are told one by one.
const MAX_TOLD: u32 = 20;

/// Follows the drive; part of the stage's state.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct WeakStretches {
    /// First shot of the drive, ns.
    begin: Option<i64>,
    /// Standard deviation of the last place, m.
    sigma_m: f64,
    open: Option<Stretch>,
    n_told: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Stretch {
    begin: i64,
    end: i64,
    n_sweeps: u32,
    n_bridged: u32,
    most_directions: u32,
    /// Sweeps whose motion was foretold by inertial samples, and by a receiver's velocities.
    n_inertial: u32,
    n_receiver: u32,
    /// Standard deviation of the place before and at the end, m.
    sigma_m: [f64; 2],
}

/// What a sweep says.
#[derive(Clone, Copy)]
struct Seen {
    begin: i64,
    end: i64,
    /// Directions that were held to what was foretold; `None` without a match.
    n_weak: Option<u32>,
    lean: Lean,
    sigma_m: f64,
}

impl WeakStretches {
    /// Takes the next sweep; what to say of a stretch that it ends.
    pub fn see(&mut self, registered: &Registered) -> Option<String> {
        self.see_sweep(Seen {
            begin: registered.stamp.0,
            end: registered.stamp.0 + i64::from(registered.duration_nanos),
            n_weak: registered.matched.as_ref().map(|matched| matched.n_weak_directions),
            lean: registered.lean,
            sigma_m: registered.covariance.fixed_view::<3, 3>(0, 0).trace().sqrt(),
        })
    }

    /// What to say of the stretch in which the drive ends.
    pub fn finish(&mut self) -> Option<String> {
        let stretch = self.open.take()?;
        self.tell(&stretch)
    }

    fn see_sweep(&mut self, seen: Seen) -> Option<String> {
        let Seen { begin, end, n_weak, lean, sigma_m } = seen;
        self.begin.get_or_insert(begin);
        let before_m = std::mem::replace(&mut self.sigma_m, sigma_m);
        if n_weak == Some(0) {
            return self.finish();
        }
        let empty = Stretch {
            begin,
            end,
            n_sweeps: 0,
            n_bridged: 0,
            most_directions: 0,
            n_inertial: 0,
            n_receiver: 0,
            sigma_m: [before_m; 2],
        };
        let stretch = self.open.get_or_insert(empty);
        stretch.end = end;
        stretch.n_sweeps += 1;
        stretch.n_bridged += u32::from(n_weak.is_none());
        stretch.most_directions = stretch.most_directions.max(n_weak.unwrap_or(6));
        stretch.n_inertial += u32::from(lean.inertial);
        stretch.n_receiver += u32::from(lean.receiver);
        stretch.sigma_m[1] = sigma_m;
        None
    }

    fn tell(&mut self, stretch: &Stretch) -> Option<String> {
        if stretch.n_sweeps < MIN_SWEEPS || self.n_told > MAX_TOLD {
            return None;
        }
        self.n_told += 1;
        if self.n_told > MAX_TOLD {
            return Some(
                "more stretches without a sure way follow; degenerate_sweeps and sweeps_bridged count them".to_owned(),
            );
        }
        let seconds = |stamp: i64| (stamp - self.begin.unwrap_or(stamp)) as f64 * 1e-9;
        let (begin, end) = (seconds(stretch.begin), seconds(stretch.end));
        let Stretch { n_sweeps, n_bridged, most_directions, sigma_m: [before_m, after_m], .. } = stretch;
        Some(format!(
            "from {begin:.1} to {end:.1} s of the drive the scene did not determine the way: {n_sweeps} sweeps, {n_bridged} of \
             them without a match, up to {most_directions} of 6 directions held to {}; the place was known to {before_m:.2} m \
             before and is to {after_m:.2} m",
            stretch.support()
        ))
    }
}

impl Stretch {
    fn support(&self) -> String {
        match (self.n_inertial, self.n_receiver) {
            (0, 0) => "constant motion".to_owned(),
            (n, 0) => format!("inertial samples ({n} sweeps)"),
            (0, n) => format!("the receiver's speed ({n} sweeps)"),
            (n, m) => format!("inertial samples ({n} sweeps) and the receiver's speed ({m})"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SWEEP: i64 = 100_000_000;

    fn told_with(lean: Lean, sweeps: &[Option<u32>]) -> Vec<String> {
        let mut stretches = WeakStretches::default();
        let see = |(number, n_weak): (usize, &Option<u32>)| {
            let begin = 5_000_000_000 + number as i64 * SWEEP;
            let sigma_m = 0.1 * number as f64;
            stretches.see_sweep(Seen { begin, end: begin + SWEEP, n_weak: *n_weak, lean, sigma_m })
        };
        let mut told: Vec<String> = sweeps.iter().enumerate().filter_map(see).collect();
        told.extend(stretches.finish());
        told
    }

    fn told(sweeps: &[Option<u32>]) -> Vec<String> {
        told_with(Lean::default(), sweeps)
    }

    #[test]
    fn a_stretch_is_told_once_with_its_times() {
        let (sure, weak, bridged) = (Some(0), Some(2), None);
        let told = told(&[sure, sure, weak, weak, bridged, sure, weak, weak, sure, weak, weak, weak]);
        assert_eq!(told.len(), 2, "two sweeps are no stretch: {told:?}");
        assert!(told[0].contains("from 0.2 to 0.5 s") && told[0].contains("3 sweeps, 1 of them"), "{}", told[0]);
        assert!(told[0].contains("up to 6 of 6 directions held to constant motion"), "{}", told[0]);
        assert!(told[0].contains("known to 0.10 m before and is to 0.40 m"), "{}", told[0]);
        assert!(told[1].contains("from 0.9 to 1.2 s") && told[1].contains("up to 2 of 6"), "{}", told[1]);
    }

    #[test]
    fn what_was_leaned_on_is_named() {
        let told = |inertial: bool, receiver: bool| told_with(Lean { inertial, receiver }, &[Some(1); 4]).concat();
        assert!(told(true, false).contains("held to inertial samples (4 sweeps);"));
        assert!(told(false, true).contains("held to the receiver's speed (4 sweeps);"));
        assert!(told(true, true).contains("held to inertial samples (4 sweeps) and the receiver's speed (4);"));
    }

    #[test]
    fn no_drive_says_more_than_the_operator_can_read() {
        let stretch = [Some(1), Some(1), Some(1), Some(0)];
        let told = told(&stretch.repeat(100));
        assert_eq!(told.len() as u32, MAX_TOLD + 1);
        assert!(told[MAX_TOLD as usize].starts_with("more"));
    }
}
