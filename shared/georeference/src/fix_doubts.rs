//! Whether the fixes of the GNSS receiver place the result.

use crate::Placed;
use std::fmt::{self, Display, Formatter};

/// A reason not to rely on the placement by fixes.
#[derive(Clone, Debug, PartialEq)]
pub enum FixDoubt {
    /// The drive has a receiver, but no usable fix.
    NoUsableFix {
        /// Fixes without a position.
        n_invalid: u64,
    },
    /// The stamps of the receiver are off by more than can be corrected.
    ReceiverDelay {
        /// By how much they are late, s; negative: early.
        late_s: f64,
    },
    /// Too few fixes agree with the result.
    FewFixesUsed {
        /// Fixes that were used.
        n_used: usize,
        /// All fixes.
        n: usize,
        /// Their quotient.
        share: f64,
        /// The least allowed share.
        limit: f64,
        /// Why they were not used.
        reason: String,
    },
}

impl FixDoubt {
    /// The doubts at the end of a drive. `counted`: fixes with and without a position. `is_expected`: the drive has a receiver.
    /// `placed`: `None` without submaps. `min_used_share`: least share of fixes that must be used; 0 accepts any.
    pub fn find(counted: [u64; 2], is_expected: bool, placed: Option<&Placed>, min_used_share: f64) -> Vec<Self> {
        let [n_valid, n_invalid] = counted;
        if n_valid == 0 {
            let is_missed = (is_expected || n_invalid > 0) && min_used_share > 0.0;
            return is_missed.then_some(Self::NoUsableFix { n_invalid }).into_iter().collect();
        }
        let Some(placed) = placed else { return Vec::new() };
        let fixes = &placed.fixes;
        let delay = fixes.delay.filter(|delay| delay.is_out_of_range() && min_used_share > 0.0);
        let share = fixes.n_used as f64 / fixes.n.max(1) as f64;
        let few = (share < min_used_share).then(|| Self::FewFixesUsed {
            n_used: fixes.n_used,
            n: fixes.n,
            share,
            limit: min_used_share,
            reason: reason(placed),
        });
        delay.map(|delay| Self::ReceiverDelay { late_s: delay.late_s }).into_iter().chain(few).collect()
    }

    /// Name of the doubt.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::NoUsableFix { .. } => "no_usable_fix",
            Self::ReceiverDelay { .. } => "receiver_delay",
            Self::FewFixesUsed { .. } => "few_fixes_used",
        }
    }

    /// The value that breaks its limit.
    pub const fn size(&self) -> f64 {
        match self {
            Self::NoUsableFix { .. } => 0.0,
            Self::ReceiverDelay { late_s } => late_s.abs(),
            Self::FewFixesUsed { share, .. } => *share,
        }
    }
}

impl Display for FixDoubt {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoUsableFix { n_invalid } => write!(
                f,
                "the drive has a GNSS receiver, but no usable fix ({n_invalid} arrived without a position): the result is not \
                 georeferenced; does the receiver send positions with heights (NMEA GGA)?"
            ),
            Self::ReceiverDelay { late_s } => {
                let (seconds, side) = (late_s.abs(), if *late_s > 0.0 { "late" } else { "early" });
                write!(
                    f,
                    "the stamps of the GNSS receiver are at least {seconds:.1} s {side} by its velocities, which is not corrected; \
                     check its clock against the clock of the LiDAR"
                )
            }
            Self::FewFixesUsed { n_used, n, share, limit, reason } => {
                let (used, limit) = (100.0 * share, 100.0 * limit);
                write!(f, "{n_used} of {n} fixes used ({used:.0} %, limit {limit:.0} %): {reason}")
            }
        }
    }
}

fn reason(placed: &Placed) -> String {
    match (placed.fixes.n, placed.fixes.reason()) {
        (0, _) => {
            "none is at a time of the trajectory, so the result is not georeferenced; check the clock of the receiver"
                .into()
        }
        (_, reason) if reason.is_empty() => {
            let n_rejected = placed.header.n_fixes_refused;
            format!("{n_rejected} disagree with the rest and the odometry; the position in the world may be wrong")
        }
        (_, reason) => {
            format!("{reason}, so the result is not georeferenced; drive farther, or set correct without gnss")
        }
    }
}
