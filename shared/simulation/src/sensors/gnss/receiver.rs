//! Receiver: code ranges with errors, a position, and a Kalman filter aided by velocity.

use super::signal::Signal;
use super::sky::{N_SATELLITES, Satellite};
use super::solve::{CodeRange, Solution, solve};
use geometry::Vector3;
use random::{gauss, hash};

/// Class of a receiver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Receiver {
    /// L1 and E1 only, broadcast orbits and ionosphere: 1 to 2 m under the open sky.
    SingleFrequency,
    /// With network corrections for orbits, clocks and ionosphere: 0.3 m under the open sky. Buildings degrade it as
    /// well.
    Differential,
}

/// A GNSS receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GnssSpec {
    /// Class.
    pub receiver: Receiver,
    /// Position of the antenna, m.
    pub antenna_in_body: [f64; 3],
}

/// Standard deviations of the measurement errors.
struct Errors {
    /// Per satellite at the zenith, m: orbit, clock, residual ionosphere and troposphere.
    slow_m: f64,
    /// Common to all satellites at the zenith, m.
    zenith_m: f64,
    /// Code noise at 45 dB-Hz, m.
    noise_m: f64,
    /// Velocity at a dilution of 1, m/s.
    speed_mps: f64,
}

/// Time scale of the slow errors, s: the ionosphere changes within tens of minutes, orbit and clock within hours.
const SLOW_SECONDS: f64 = 900.0;
/// Elevation mask: sine of 10 degrees.
const MASK: f64 = 0.174;
/// Tracking threshold, dB-Hz.
const WEAKEST_DBHZ: f64 = 27.0;
/// Process noise of the filter per second, m.
const TRUST_M: f64 = 0.15;
/// The filter restarts after this many seconds without a position.
const FORGET_SECONDS: u32 = 5;

impl Receiver {
    /// All classes.
    pub const ALL: [Self; 2] = [Self::SingleFrequency, Self::Differential];

    /// Name in rig files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::SingleFrequency => "single_frequency",
            Self::Differential => "differential",
        }
    }
    /// GGA quality indicator of its fixes.
    pub const fn quality(self) -> u32 {
        match self {
            Self::SingleFrequency => 1,
            Self::Differential => 2,
        }
    }
    /// User range errors as in the GPS SPS performance standard (2020, table 3.8-1 and appendix B): 0.5 to 1 m of orbit
    /// and clock, some metres of ionosphere after the broadcast model.
    const fn errors(self) -> Errors {
        match self {
            Self::SingleFrequency => Errors { slow_m: 1.0, zenith_m: 1.5, noise_m: 0.3, speed_mps: 0.05 },
            Self::Differential => Errors { slow_m: 0.2, zenith_m: 0.2, noise_m: 0.2, speed_mps: 0.03 },
        }
    }
}

/// Position and velocity errors of a fix.
#[derive(Clone, Debug)]
pub struct Position {
    /// Position error in the world frame, m.
    pub error: Vector3<f64>,
    /// Velocity error in the world frame, m/s.
    pub speed_error: Vector3<f64>,
    /// Horizontal dilution of precision.
    pub hdop: f64,
    /// Code ranges in the solution.
    pub used: Vec<CodeRange>,
}

/// State of a receiver; updated once a second.
#[derive(Clone, Debug)]
pub struct Tracking {
    receiver: Receiver,
    seed: u64,
    second: u64,
    slow: Vec<f64>,
    zenith: f64,
    /// `None` before the first position and after a long outage.
    filtered: Option<FilteredPosition>,
    seconds_without: u32,
}

/// A satellite and its signal at the antenna.
#[derive(Clone, Copy, Debug)]
pub struct ReceivedSignal {
    /// The satellite.
    pub satellite: Satellite,
    /// Its signal.
    pub signal: Signal,
}

/// State of the filter per axis of the world frame.
#[derive(Clone, Copy, Debug)]
struct FilteredPosition {
    /// Error of the position, m.
    error: Vector3<f64>,
    /// Its variances, m^2.
    variances: Vector3<f64>,
}

impl Tracking {
    /// A receiver in steady state.
    pub fn new(receiver: Receiver, seed: u64) -> Self {
        let errors = receiver.errors();
        let start = |i: usize| f64::from(gauss(hash(seed, i as u64)));
        let slow = (0..N_SATELLITES).map(|i| errors.slow_m * start(i)).collect();
        let zenith = errors.zenith_m * start(N_SATELLITES);
        Self { receiver, seed, second: 0, slow, zenith, filtered: None, seconds_without: 0 }
    }

    /// The position one second later; `None` without a solution.
    pub fn next(&mut self, signals: &[ReceivedSignal]) -> Option<Position> {
        let ranges = signals.iter().filter_map(|received| self.range(&received.satellite, &received.signal)).collect();
        let solution = solve(ranges);
        let position = self.filter(solution);
        self.second += 1;
        self.wander();
        position
    }

    fn range(&self, satellite: &Satellite, signal: &Signal) -> Option<CodeRange> {
        if satellite.direction.z < MASK || signal.strength_dbhz < WEAKEST_DBHZ {
            return None;
        }
        let errors = self.receiver.errors();
        // Obliquity of a thin layer at 350 km, as in Klobuchar's model.
        let cos = (1.0 - satellite.direction.z.powi(2)).sqrt();
        let slant = 1.0 / (1.0 - (0.947_9 * cos).powi(2)).sqrt();
        let noise_m = errors.noise_m * 10_f64.powf((45.0 - signal.strength_dbhz) / 20.0);
        let slow_m = slant * (self.slow[satellite.index] + self.zenith);
        let error_m = slow_m + noise_m * self.draw(satellite.index as u64) + signal.detour_m;
        // Receivers assume a multipath error of one metre at the zenith, and more at lower elevations.
        let sigma_m = noise_m.hypot(slant * errors.slow_m.hypot(1.0));
        let system = satellite.system;
        let direction = satellite.direction;
        Some(CodeRange { system, direction, error_m, sigma_m, is_reflected: signal.is_reflected })
    }

    /// Kalman filter per axis: predicted with the measured velocity, updated with new positions.
    fn filter(&mut self, solution: Option<Solution>) -> Option<Position> {
        let spread = self.filtered.map(|filtered| FilteredPosition {
            variances: filtered.variances.add_scalar(TRUST_M * TRUST_M),
            ..filtered
        });
        let Some(solution) = solution else {
            self.seconds_without += 1;
            self.filtered = spread.filter(|_| self.seconds_without <= FORGET_SECONDS);
            return None;
        };
        self.seconds_without = 0;
        let filtered = match spread {
            None => FilteredPosition { error: solution.error, variances: solution.variances },
            Some(FilteredPosition { error, variances }) => {
                let gain = variances.component_div(&(variances + solution.variances));
                let error = error + gain.component_mul(&(solution.error - error));
                FilteredPosition { error, variances: variances - gain.component_mul(&variances) }
            }
        };
        self.filtered = Some(filtered);
        let speed_mps = self.receiver.errors().speed_mps * solution.hdop;
        let speed_error = Vector3::from_fn(|axis, _| speed_mps * self.draw(100 + axis as u64));
        Some(Position { error: filtered.error, speed_error, hdop: solution.hdop, used: solution.used })
    }

    /// Advances the slow errors, which are first-order Gauss-Markov processes.
    fn wander(&mut self) {
        let errors = self.receiver.errors();
        let memory = (-1.0 / SLOW_SECONDS).exp();
        let fresh = (1.0 - memory * memory).sqrt();
        for i in 0..self.slow.len() {
            self.slow[i] = memory * self.slow[i] + fresh * errors.slow_m * self.draw(200 + i as u64);
        }
        self.zenith = memory * self.zenith + fresh * errors.zenith_m * self.draw(300);
    }

    /// A normal random number for a second and a purpose.
    fn draw(&self, kind: u64) -> f64 {
        f64::from(gauss(hash(self.seed ^ 0x6e55, self.second << 10 | kind)))
    }
}
