//! Spin direction of the LiDAR: checks whether the point times deskew a sweep or distort it.

use super::Verdict;
use crate::survey::{RawSweep, Survey};
use drive::Drive;
use registration::{Odometry, OdometrySettings, Revolution, SensorMounting, SpinDirection, Sweep, TimedPoint};

/// Number of first sweeps that are not compared, because the motion is not accurate yet.
const SETTLED: usize = 8;
/// Another spin direction must lower the residuals by this factor.
const MAX_SHARE: f64 = 0.93;

/// Residuals of a stretch of the drive for each kind of point times.
#[derive(Clone, Debug, PartialEq)]
pub struct SpinCosts {
    /// The first entry is the current one.
    pub by_spin: Vec<SpinCost>,
}

/// Residuals for one kind of point times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpinCost {
    /// Name of the kind.
    pub name: &'static str,
    /// Mean cost.
    pub cost: f64,
}

#[derive(Clone, Copy, PartialEq)]
enum Times {
    /// Unchanged times.
    Given,
    /// Reversed times, from the end of the sweep to its start.
    Reversed,
    /// No times.
    None,
    /// Times from the azimuth.
    Turning(SpinDirection),
}

impl SpinCosts {
    /// Registers the stretch of a survey with each kind of times; `None` if the vehicle did not move long enough.
    pub fn measure(drive: &Drive, survey: &Survey, untimed_turn: Option<SpinDirection>) -> Option<Self> {
        let stretch = &survey.stretch;
        if stretch.len() <= SETTLED + 2 {
            return None;
        }
        let has_times = stretch.iter().all(|sweep| sweep.header.has_times != 0);
        let untimed = [
            ("none", Times::None),
            ("clockwise", Times::Turning(SpinDirection::Clockwise)),
            ("counterclockwise", Times::Turning(SpinDirection::Counterclockwise)),
        ];
        let mut kinds =
            if has_times { vec![("given", Times::Given), ("reversed", Times::Reversed)] } else { untimed.to_vec() };
        if !has_times {
            let present = untimed_turn.map_or(Times::None, Times::Turning);
            kinds.sort_by_key(|(_, times)| *times != present);
        }
        let cost =
            |(name, times): &(&'static str, Times)| Some(SpinCost { name, cost: mean_cost(drive, stretch, *times)? });
        let by_spin: Vec<SpinCost> = kinds.iter().filter_map(cost).collect();
        (by_spin.len() > 1).then_some(Self { by_spin })
    }
}

/// Mean cost of the matches after the first sweeps; `None` if the sweeps do not match.
fn mean_cost(drive: &Drive, stretch: &[RawSweep], times: Times) -> Option<f64> {
    let body_from_lidar = drive.rig().body_from_lidar;
    let mounting = SensorMounting { body_from_lidar, ..SensorMounting::default() };
    let mut odometry = Odometry::new(OdometrySettings { mounting, ..OdometrySettings::default() }, body_from_lidar);
    let mut costs = Vec::new();
    for (index, raw) in stretch.iter().enumerate() {
        for registered in odometry.register(&timed(raw, times)).ok()? {
            if index >= SETTLED {
                // A sweep without a match has the highest cost.
                costs.push(
                    registered.matched.as_ref().map_or(1.0, |matched| matched.rms_m.powi(2) / 0.01 + matched.cost),
                );
            }
        }
    }
    (!costs.is_empty()).then(|| costs.iter().sum::<f64>() / costs.len() as f64)
}

fn timed(raw: &RawSweep, times: Times) -> Sweep {
    let untimed = match times {
        Times::Turning(spin) => Some(Revolution { spin, duration_nanos: raw.header.duration_nanos }),
        _ => None,
    };
    let sweep = Sweep::from_rows(raw.stamp, &raw.header, &raw.rows, untimed);
    if times != Times::Reversed {
        return sweep;
    }
    let last = sweep.duration_nanos();
    let reversed = |point: &TimedPoint| TimedPoint { offset_nanos: last - point.offset_nanos, ..*point };
    Sweep::new(raw.stamp, sweep.points().iter().map(reversed).collect(), raw.header.n_rings)
}

pub(super) fn verdict(drive: &Drive, survey: &Survey, untimed_turn: Option<SpinDirection>) -> Verdict {
    let costs = SpinCosts::measure(drive, survey, untimed_turn);
    let Some(SpinCosts { by_spin }) = costs else {
        return Verdict::unknown("spin", "lidar", "the vehicle did not move for two seconds");
    };
    let list: Vec<String> = by_spin.iter().map(|SpinCost { name, cost }| format!("{name} {cost:.4}")).collect();
    let value = format!("residuals by times of the points: {}", list.join(", "));
    let present = by_spin[0].cost;
    // The first of equal costs.
    let best = by_spin.iter().copied().reduce(|best, other| if other.cost < best.cost { other } else { best });
    let better = best.filter(|best| best.cost < MAX_SHARE * present).map(|best| best.name);
    let advice = match better {
        Some("reversed") => "the points are fired in the opposite direction of their times: check the order of the \
                             points, or the sense of the azimuth"
            .to_owned(),
        Some(name) => format!("set [slam_aggregate] untimed_turn = {name:?} in launch.toml: the points have no times"),
        None => String::new(),
    };
    let limit = format!("another below {MAX_SHARE} of the first");
    Verdict::new("spin", "lidar", better.is_none(), [value, limit, advice])
}
