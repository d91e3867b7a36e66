//! The form of the clouds of a recording: unit and origin of times, order of the beams, scale of intensities, map origin.

use super::coordinates::relative;
use super::{Elevations, Field, IntensitySample, IntensityScale, MapOrigin, RawCloud, Rings, TimeForm};
use crate::cloud::{CloudPoint, FiredCloud, FiredPoint};
use std::ops::RangeInclusive;

/// Maximum duration of a sweep relative to the time to the next stamp; the drive has the same rule.
const MAX_OVERLAP: f64 = 1.1;
/// Times in another unit than the documented one span at least one of so many parts of the time to the next stamp.
const MAX_PARTS: f64 = 2.0;
/// Duration of a revolution where the time to the next stamp is unknown, s: sensors turn at 5 to 20 Hz.
const REVOLUTION_S: RangeInclusive<f64> = 0.04..=0.22;
/// Latest time of a point that is read, ns: below the range of u32.
const MAX_OFFSET_NANOS: i64 = 4_000_000_000;
/// The first points of sweeps differ by this time, ns: the speed of motors varies.
const JITTER_NANOS: i64 = 2_000_000;
/// Largest correction of the stamps by the times of the points, ns.
const MAX_SHIFT_NANOS: i64 = 1_000_000_000;

/// Determines the form of a recording from a few of its clouds.
#[derive(Debug, Default)]
pub struct FormBuilder {
    is_drive: bool,
    interval_s: Option<f64>,
    unit: Option<&'static str>,
    n_beams: Option<u16>,
    clouds: Vec<Examined>,
    elevations: Elevations,
    intensities: IntensitySample,
    beams: Option<String>,
    origin: Option<MapOrigin>,
    viewpoint: Option<String>,
}

/// Times of an examined cloud.
#[derive(Debug)]
struct Examined {
    name: String,
    /// Stamp of the sweep, ns; `None` if it is only assumed.
    stamp: Option<i64>,
    range: [f64; 2],
    returns: [f64; 2],
}

/// Rules for reading the clouds of a recording.
#[derive(Clone, Debug, Default)]
pub struct CloudForm {
    times: Option<Times>,
    beams: Beams,
    /// Scale of the intensities.
    pub intensities: IntensityScale,
    /// Whole meters that are subtracted from map coordinates.
    pub origin: Option<MapOrigin>,
    /// The first pose of the sensor that a file states, and that is not applied.
    pub viewpoint: Option<String>,
    /// Name of the times that are not read: their unit is unknown.
    pub unread_times: Option<String>,
    /// Lines of the report about times and rings.
    pub report: Vec<String>,
}

#[derive(Clone, Debug)]
struct Times {
    form: TimeForm,
    start: Start,
    /// Whether the times of missing returns are invalid.
    only_returns: bool,
    /// Whether clouds without times are read.
    is_optional: bool,
}

/// Origin of the times in a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Start {
    /// The stamp of the sweep plus this time, ns.
    Stamp(i64),
    /// 1970; the sweep begins at its stamp plus this time, ns.
    Epoch(i64),
    /// The first point of each cloud is at the stamp.
    First,
}

#[derive(Clone, Debug, Default)]
enum Beams {
    #[default]
    Absent,
    /// Numbered from the lowest.
    AsStored,
    Mapped(Rings),
}

/// Reason why a cloud does not follow the form of its recording.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FieldFault {
    /// The field of the other clouds is missing.
    #[error("has no {0}; the first files have")]
    Missing(&'static str),
    /// A time is before the stamp, or too late.
    #[error("point {index}: {field} {found} must be a time after the sweep's stamp, 0 to 4 s ({unit})")]
    Time {
        /// Index of the point.
        index: usize,
        /// Name of the field.
        field: String,
        /// The value found.
        found: f64,
        /// Unit of the field.
        unit: &'static str,
    },
    /// A ring is not a beam number.
    #[error("point {index}: ring {found} must be a whole number from 0 to 255")]
    Ring {
        /// Index of the point.
        index: usize,
        /// The value found.
        found: f64,
    },
    /// A beam is unknown.
    #[error("point {index} is of beam {found}; the LiDAR has {n_beams}")]
    Beam {
        /// Index of the point.
        index: usize,
        /// The value found.
        found: f64,
        /// Number of beams.
        n_beams: usize,
    },
    /// Map coordinates in a recording whose other clouds are in the frame of the LiDAR.
    #[error("has map coordinates; the first files are in the frame of the LiDAR")]
    OtherFrame,
}

impl FormBuilder {
    /// For clouds of any writer. `interval_s`: shortest time from one stamp to the next, s; a longer span does not belong to one
    /// sweep. `n_beams`: beams of the LiDAR, if known.
    pub fn new(interval_s: Option<f64>, n_beams: Option<u16>) -> Self {
        Self { interval_s, n_beams, ..Self::default() }
    }

    /// For files of a drive, which follow its page where nothing shows otherwise: `t` in ns, `time` in s, from the stamp, and
    /// `ring` from the lowest beam.
    pub fn for_drive(interval_s: Option<f64>, n_beams: Option<u16>) -> Self {
        Self { is_drive: true, ..Self::new(interval_s, n_beams) }
    }

    /// Accepts times of this unit only, which the format states.
    #[must_use]
    pub fn with_unit(mut self, unit: &'static str) -> Self {
        self.unit = Some(unit);
        self
    }

    /// Adds a cloud. `stamp`: stamp of its sweep, ns, if it was recorded. The origin is the origin of the first cloud with map
    /// coordinates.
    pub fn add(&mut self, cloud: &RawCloud, stamp: Option<i64>) -> Result<(), super::CoordinateFault> {
        let origin = cloud.map_origin()?;
        self.origin = self.origin.or(origin);
        if self.viewpoint.is_none() {
            self.viewpoint.clone_from(&cloud.viewpoint);
        }
        if let (Some(column), Some(range)) = (&cloud.times, cloud.time_range(false)) {
            let returns = cloud.time_range(true).unwrap_or(range);
            self.clouds.push(Examined { name: column.name.clone(), stamp, range, returns });
        }
        if let Some(column) = &cloud.intensities {
            self.intensities.add(column);
        }
        if let Some(column) = &cloud.beams {
            self.beams = Some(column.name.clone());
            let origin = origin.and(self.origin);
            for (index, beam) in column.values.iter().enumerate() {
                if cloud.is_return(index) {
                    let position = relative(cloud.positions[index], origin).map(|value| value as f32);
                    self.elevations.add(beam_number(*beam), position);
                }
            }
        }
        Ok(())
    }

    /// The form of the recording.
    pub fn finish(self) -> CloudForm {
        let times = self.times();
        let rings = self.beams.as_ref().and_then(|_| self.elevations.rings(self.n_beams, 1));
        let is_ring = self.beams.as_ref().is_some_and(|name| Field::Ring.names()[0].eq_ignore_ascii_case(name));
        let beams = match &rings {
            Some(rings) if self.is_drive && rings.is_identity() => Beams::AsStored,
            Some(rings) => Beams::Mapped(rings.clone()),
            None if self.is_drive && is_ring => Beams::AsStored,
            None => Beams::Absent,
        };
        let report = vec![self.report_of_times(times.as_ref()), self.report_of_rings(rings.as_ref(), &beams)];
        let unread_times = self.clouds.first().map(|cloud| cloud.name.clone()).filter(|_| times.is_none());
        let intensities = self.intensities.scale();
        CloudForm { times, beams, intensities, origin: self.origin, viewpoint: self.viewpoint, unread_times, report }
    }

    fn times(&self) -> Option<Times> {
        if !self.is_drive && self.clouds.iter().any(|cloud| self.is_long(cloud)) {
            return None;
        }
        let forms = |only_returns: bool| self.clouds.iter().filter_map(move |cloud| self.form(cloud, only_returns));
        let only_returns = forms(false).next().is_none();
        // The unit of most clouds; of units with equal counts, the first.
        let votes = |unit: &str| forms(only_returns).filter(|form| form.unit() == unit).count();
        let mut form: Option<TimeForm> = None;
        for candidate in forms(only_returns) {
            if form.is_none_or(|form| votes(candidate.unit()) > votes(form.unit())) {
                form = Some(candidate);
            }
        }
        let Some(form) = form else { return self.documented_times() };
        Some(Times { form, start: self.start(form, only_returns), only_returns, is_optional: self.is_drive })
    }

    /// The times of files of a drive that do not have the span of a sweep: in the documented unit of their name.
    fn documented_times(&self) -> Option<Times> {
        let name = &self.clouds.first().filter(|_| self.is_drive)?.name;
        let unit = documented_unit(name)?;
        Some(Times { form: TimeForm::in_unit(unit)?, start: Start::Stamp(0), only_returns: false, is_optional: true })
    }

    fn form(&self, cloud: &Examined, only_returns: bool) -> Option<TimeForm> {
        let [min, max] = if only_returns { cloud.returns } else { cloud.range };
        let form = TimeForm::from_range(min, max, cloud.stamp.unwrap_or(i64::MAX))?;
        let parts = self.interval_s.map(|interval_s| form.seconds(max - min) / interval_s);
        let is_expected = if self.is_drive {
            // A part of a sweep in the documented unit may look as a whole one in another unit.
            documented_unit(&cloud.name) == Some(form.unit())
                || match parts {
                    Some(parts) => (1.0 / MAX_PARTS..=MAX_OVERLAP).contains(&parts),
                    None => REVOLUTION_S.contains(&form.seconds(max - min)),
                }
        } else {
            parts.is_none_or(|parts| parts <= MAX_OVERLAP)
        };
        (self.unit.is_none_or(|unit| unit == form.unit()) && is_expected).then_some(form)
    }

    /// Whether the times of a cloud span more than the time to the next stamp.
    fn is_long(&self, cloud: &Examined) -> bool {
        let [min, max] = cloud.range;
        let form = TimeForm::from_range(min, max, i64::MAX);
        let form = form.filter(|form| self.unit.is_none_or(|unit| unit == form.unit()));
        let span_s = form.map(|form| form.seconds(max - min));
        span_s.zip(self.interval_s).is_some_and(|(span_s, interval_s)| span_s > MAX_OVERLAP * interval_s)
    }

    /// Origin of times in this form.
    fn start(&self, form: TimeForm, only_returns: bool) -> Start {
        let first = |cloud: &Examined| form.offset_nanos(if only_returns { cloud.returns[0] } else { cloud.range[0] });
        let firsts: Option<Vec<i64>> = self.clouds.iter().map(first).collect();
        let stamps: Option<Vec<i64>> = self.clouds.iter().map(|cloud| cloud.stamp).collect();
        let Some(first) = firsts.as_ref().and_then(|firsts| firsts.iter().copied().min()) else { return Start::First };
        if form.is_from_stamp() {
            return match &stamps {
                _ if first >= 0 && self.is_drive => Start::Stamp(0),
                _ if first >= 0 => Start::First,
                Some(stamps)
                    if first > -MAX_SHIFT_NANOS && stamps.iter().all(|stamp| stamp.saturating_add(first) >= 0) =>
                {
                    Start::Stamp(first)
                }
                _ => Start::First,
            };
        }
        if !self.is_drive || !form.is_from_epoch() {
            return Start::First;
        }
        let after = firsts.zip(stamps).and_then(|(firsts, stamps)| {
            firsts.iter().zip(stamps).map(|(first, stamp)| first.checked_sub(stamp)).collect::<Option<Vec<i64>>>()
        });
        match after.and_then(|after| after.into_iter().min()) {
            Some(after) if (-JITTER_NANOS..MAX_SHIFT_NANOS / 2).contains(&after) => Start::Epoch(0),
            Some(after) if after < 0 && after > -MAX_SHIFT_NANOS => Start::Epoch(after),
            _ => Start::First,
        }
    }

    fn report_of_times(&self, times: Option<&Times>) -> String {
        let Some(name) = self.clouds.first().map(|cloud| cloud.name.as_str()) else {
            return "no point times: the files contain no times".to_owned();
        };
        match times {
            Some(Times { form, start, .. }) => {
                let from = match start {
                    Start::First => "from the first point of each file".to_owned(),
                    Start::Stamp(0) => "from the stamp".to_owned(),
                    Start::Epoch(0) => "since 1970".to_owned(),
                    Start::Stamp(shift) | Start::Epoch(shift) => {
                        format!("before the stamps: sweeps begin {} ms earlier", -shift / 1_000_000)
                    }
                };
                format!("point times: {name}, in {}, {from}", form.unit())
            }
            None => format!(
                "no point times: {name} does not span 5 ms to the next stamp, at most 0.5 s, in s, ms, us or ns"
            ),
        }
    }

    fn report_of_rings(&self, rings: Option<&Rings>, beams: &Beams) -> String {
        match (rings, &self.beams) {
            (Some(rings), Some(name)) => format!("rings: {name}, {} beams counted {}", rings.n_rings(), rings.order),
            (None, Some(name)) if matches!(beams, Beams::AsStored) => format!("rings: {name}, as in the files"),
            (None, Some(name)) => {
                format!("no rings: {name} does not number the beams of the LiDAR, each of one elevation")
            }
            (_, None) => "no rings: the files contain no rings".to_owned(),
        }
    }
}

impl CloudForm {
    /// The form of clouds without times and rings.
    pub fn untimed(intensities: IntensityScale) -> Self {
        Self { intensities, ..Self::default() }
    }

    /// Lines about intensities and coordinates that are not read as they are stored.
    pub fn changes(&self) -> Vec<String> {
        let mut lines: Vec<String> =
            Some(self.intensities.text.clone()).into_iter().filter(|text| !text.is_empty()).collect();
        if let Some(MapOrigin([x, y, z])) = self.origin {
            lines.push(format!(
                "map coordinates: {x} {y} {z} m is subtracted and taken as the origin of the LiDAR; the sweeps are registered by another \
                 program, or their frame is unknown: sweeps in the frame of the LiDAR give a path"
            ));
        }
        lines.extend(self.viewpoint_line());
        lines
    }

    /// The line about a pose of the sensor that is not applied.
    pub fn viewpoint_line(&self) -> Option<String> {
        self.viewpoint.as_ref().map(|viewpoint| {
            format!(
                "{viewpoint} is not applied: the points are taken as in the frame of the LiDAR; if they are in the frame in which the LiDAR \
                 has this pose, transform them before the import"
            )
        })
    }

    /// Time by which the stamps of the recording are corrected: sweeps begin earlier if stamps are at their ends, ns.
    pub fn shift_nanos(&self) -> i64 {
        match self.times.as_ref().map(|times| times.start) {
            Some(Start::Stamp(shift) | Start::Epoch(shift)) => shift,
            _ => 0,
        }
    }

    /// Name of the unit of the times.
    pub fn unit(&self) -> Option<&'static str> {
        self.times.as_ref().map(|times| times.form.unit())
    }

    /// The points of a cloud with rings and times. Intensities are as stored. `stamp`: stamp of its sweep before the
    /// correction, ns.
    pub fn fired(&self, cloud: &RawCloud, stamp: i64) -> Result<FiredCloud, FieldFault> {
        if cloud.positions.is_empty() {
            return Ok(FiredCloud::default());
        }
        let offsets = match &self.times {
            Some(times) if cloud.times.is_some() || !times.is_optional => Some(times.offsets(cloud, stamp)?),
            _ => None,
        };
        let origin = if cloud.has_map_coordinates() { Some(self.origin.ok_or(FieldFault::OtherFrame)?) } else { None };
        let mut points = Vec::with_capacity(cloud.positions.len());
        for (index, position) in cloud.positions.iter().enumerate() {
            let [x, y, z] = relative(*position, origin).map(|value| value as f32);
            let intensity = cloud.intensities.as_ref().map_or(0.0, |column| column.values[index]) as f32;
            let ring = self.beams.ring(cloud, index)?;
            let offset_nanos = offsets.as_ref().map_or(0, |offsets| offsets[index]);
            points.push(FiredPoint { point: CloudPoint { x, y, z, intensity }, ring, offset_nanos });
        }
        let has_rings = !matches!(self.beams, Beams::Absent) && cloud.beams.is_some();
        Ok(FiredCloud { points, has_rings, has_times: offsets.is_some() })
    }
}

impl Times {
    /// Times of all points after the corrected stamp, ns; 0 for missing returns without a valid time.
    fn offsets(&self, cloud: &RawCloud, stamp: i64) -> Result<Vec<u32>, FieldFault> {
        let column = cloud.times.as_ref().ok_or(FieldFault::Missing("point times"))?;
        let first = match self.start {
            Start::Stamp(shift) => shift,
            Start::Epoch(shift) => stamp.saturating_add(shift),
            Start::First => {
                let first = cloud.time_range(self.only_returns).and_then(|[min, _]| self.form.offset_nanos(min));
                first.unwrap_or(0)
            }
        };
        let offset = |(index, time): (usize, &f64)| {
            let after = self.form.offset_nanos(*time).and_then(|nanos| nanos.checked_sub(first));
            // The first point of a sweep may be a little earlier than the first points of the examined ones.
            let is_corrected = !matches!(self.start, Start::Stamp(0) | Start::First);
            let after = after.map(|after| if is_corrected && after > -5 * JITTER_NANOS { after.max(0) } else { after });
            match after {
                Some(after) if (0..=MAX_OFFSET_NANOS).contains(&after) => Ok(after as u32),
                _ if !cloud.is_return(index) => Ok(0),
                _ => {
                    let field = column.name.clone();
                    Err(FieldFault::Time { index, field, found: *time, unit: self.form.unit() })
                }
            }
        };
        column.values.iter().enumerate().map(offset).collect()
    }
}

impl Beams {
    fn ring(&self, cloud: &RawCloud, index: usize) -> Result<u8, FieldFault> {
        if matches!(self, Self::Absent) {
            return Ok(0);
        }
        let found = match &cloud.beams {
            Some(column) => column.values[index],
            None if matches!(self, Self::AsStored) => return Ok(0),
            None => return Err(FieldFault::Missing("rings")),
        };
        let ring = match self {
            Self::Absent => Some(0),
            Self::AsStored if (0.0..=255.0).contains(&found) && found.fract() == 0.0 => Some(found as u8),
            Self::AsStored => None,
            Self::Mapped(rings) => rings.get(beam_number(found)),
        };
        match (ring, self) {
            (Some(ring), _) => Ok(ring),
            _ if !cloud.is_return(index) => Ok(0),
            (None, Self::Mapped(rings)) => Err(FieldFault::Beam { index, found, n_beams: rings.n_rings() }),
            (None, _) => Err(FieldFault::Ring { index, found }),
        }
    }
}

/// Unit of a field in the files of a drive.
fn documented_unit(name: &str) -> Option<&'static str> {
    match name {
        "t" => Some("ns"),
        "time" => Some("s"),
        _ => None,
    }
}

/// The number of a beam; a number that no sensor has for other values.
fn beam_number(value: f64) -> u16 {
    if value.fract() == 0.0 && (0.0..65_535.0).contains(&value) { value as u16 } else { u16::MAX }
}

#[cfg(test)]
mod tests;
