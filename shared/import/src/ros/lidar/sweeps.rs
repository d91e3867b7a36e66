//! Clouds of a bag as one PCD file per sweep.

use crate::error::ImportError;
use crate::plan::TextFile;
use crate::rings::model_of_beams;
use formats::cloud_fields::{Elevations, MapOrigin, PointFlags, RawCloud, Rings, TimeForm, ValueType};

use crate::ros::cloud::RawPoint;
use drive::TIMES_FILE;
use formats::cloud::{CloudPoint, FiredCloud, FiredPoint};
use formats::pcd::pcd_from_cloud;
use lidar::{Lidar, Model, SweepReader};
use std::fs::File;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

/// Clouds from which the form of the times and the elevations of the beams are determined. The first revolution of a
/// recording is often incomplete.
const EXAMINED: usize = 8;
/// Points nearer than this are missing returns, m.
const MIN_RANGE_M: f32 = 0.1;
/// Longest time from the first to the last point, ns.
const MAX_SPAN_NANOS: i64 = 500_000_000;

/// A cloud as stored in the message.
struct Cloud {
    stamp: i64,
    position_type: ValueType,
    points: Vec<RawPoint>,
}

/// Writes the sweeps of a topic.
pub(crate) struct Sweeps {
    folder: PathBuf,
    model: Option<Model>,
    /// Clouds that wait for the decision.
    waiting: Vec<Cloud>,
    decision: Option<Decision>,
    /// Stamps of the sweeps and the times of their last points, ns.
    written: Vec<(i64, u32)>,
    counts: Counts,
}

/// Rules for reading the clouds of a topic.
struct Decision {
    form: Option<TimeForm>,
    rings: Option<Rings>,
    model: Model,
    /// Subtracted from map coordinates.
    origin: Option<MapOrigin>,
}

/// The sweeps of a topic after all clouds were written.
pub(crate) struct FinishedSweeps {
    pub model: Model,
    /// Subtracted from map coordinates.
    pub origin: Option<MapOrigin>,
    /// The file of the times.
    pub times: TextFile,
    /// Lines of the report.
    pub report: Vec<String>,
}

#[derive(Default)]
struct Counts {
    empty: u64,
    same_stamp: u64,
    /// Clouds whose times do not fit into one sweep.
    bad_times: u64,
    /// Points whose beam has no ring.
    without_ring: u64,
}

impl Sweeps {
    /// Writer to `folder`, which must exist.
    pub fn new(folder: PathBuf, model: Option<Model>) -> Self {
        Self { folder, model, waiting: Vec::new(), decision: None, written: Vec::new(), counts: Counts::default() }
    }

    /// Adds a cloud. `n_rows`: rows of the message, which are beams if there is more than one.
    pub fn add(
        &mut self,
        stamp: i64,
        n_rows: u32,
        position_type: ValueType,
        points: impl Iterator<Item = RawPoint>,
    ) -> Result<(), String> {
        let points: Vec<RawPoint> = points.filter(is_return).collect();
        if points.is_empty() {
            self.counts.empty += 1;
            return Ok(());
        }
        let limit = SweepReader::MAX_RETURNS;
        if points.len() > limit {
            return Err(format!("{} points; a sweep has at most {limit}", points.len()));
        }
        let cloud = Cloud { stamp, position_type, points };
        if self.decision.is_some() {
            return self.write(&cloud);
        }
        self.waiting.push(cloud);
        if self.waiting.len() == EXAMINED { self.decide(n_rows) } else { Ok(()) }
    }

    fn decide(&mut self, n_rows: u32) -> Result<(), String> {
        let form = self
            .waiting
            .iter()
            .find_map(|cloud| time_range(cloud).and_then(|[a, b]| TimeForm::from_range(a, b, cloud.stamp)));
        let mut origin = None;
        for cloud in &self.waiting {
            origin = origin.or(cloud.origin()?);
        }
        let mut elevations = Elevations::default();
        for point in self.waiting.iter().flat_map(|cloud| &cloud.points) {
            if let Some(ring) = point.ring {
                elevations.add(ring, relative(point.position, origin));
            }
        }
        let of_model = self.model.map(|model| Lidar::from(model).n_rings()).filter(|n| *n > 0);
        let rings = elevations.rings(of_model.and_then(|n| u16::try_from(n).ok()), n_rows);
        let model = self.model.unwrap_or_else(|| model_of_beams(rings.as_ref().map_or(0, Rings::n_rings)));
        self.decision = Some(Decision { form, rings, model, origin });
        for cloud in std::mem::take(&mut self.waiting) {
            self.write(&cloud)?;
        }
        Ok(())
    }

    fn write(&mut self, cloud: &Cloud) -> Result<(), String> {
        let Some(decision) = &self.decision else { return Ok(()) };
        let times = match decision.form {
            Some(form) => {
                let times: Option<Vec<f64>> = cloud.points.iter().map(|point| point.time).collect();
                times.and_then(|times| form.nanos(times.into_iter(), cloud.stamp))
            }
            None => Some(vec![cloud.stamp; cloud.points.len()]),
        };
        let range = times.as_ref().and_then(|times| Some((*times.iter().min()?, *times.iter().max()?)));
        let sweep = range.filter(|(begin, end)| end.checked_sub(*begin).is_some_and(|span| span <= MAX_SPAN_NANOS));
        let (Some(times), Some((begin, end))) = (times, sweep) else {
            self.counts.bad_times += 1;
            return Ok(());
        };
        if begin < 0 {
            return Err(format!("time {begin} ns is before 1970; must be a time since 1970"));
        }
        if cloud.origin()?.is_some() && decision.origin.is_none() {
            return Err("has map coordinates; the first clouds are in the frame of the LiDAR".to_owned());
        }
        let origin = cloud.origin()?.and(decision.origin);
        let mut points = Vec::with_capacity(times.len());
        let mut n_without = 0;
        for (point, time) in cloud.points.iter().zip(times) {
            let ring = match &decision.rings {
                Some(rings) => point.ring.and_then(|beam| rings.get(beam)),
                None => Some(0),
            };
            let Some(ring) = ring else {
                n_without += 1;
                continue;
            };
            let [x, y, z] = relative(point.position, origin);
            let intensity = point.intensity;
            let offset_nanos = (time - begin) as u32;
            points.push(FiredPoint { point: CloudPoint { x, y, z, intensity }, ring, offset_nanos });
        }
        self.counts.without_ring += n_without;
        let has_rings = decision.rings.is_some();
        let has_times = decision.form.is_some();
        // All stamps since 2001 have 19 digits, so the order of the names is the order of the stamps.
        let path = self.folder.join(format!("{begin:019}.pcd"));
        let mut file = match File::create_new(&path) {
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {
                self.counts.same_stamp += 1;
                return Ok(());
            }
            file => file.map_err(|error| format!("{}: {error}", path.display()))?,
        };
        let bytes = pcd_from_cloud(&FiredCloud { points, has_rings, has_times });
        file.write_all(&bytes).map_err(|error| format!("{}: {error}", path.display()))?;
        self.written.push((begin, (end - begin) as u32));
        Ok(())
    }

    /// Writes the waiting clouds.
    pub fn finish(
        mut self,
        source: &Path,
        topic: &str,
        place: &str,
        fields: &FieldNames,
    ) -> Result<FinishedSweeps, ImportError> {
        if self.decision.is_none() {
            self.decide(fields.n_rows).map_err(|rule| ImportError::at_part(source, topic, rule))?;
        }
        let Some(decision) = self.decision else { return Err(ImportError::at_part(source, topic, "no clouds")) };
        if self.written.is_empty() {
            let Counts { empty, bad_times, .. } = self.counts;
            let rule = format!("no sweeps: {empty} clouds without points, {bad_times} with times of more than 0.5 s");
            return Err(ImportError::at_part(source, topic, rule));
        }
        self.written.sort_unstable();
        let n_sweeps = self.written.len();
        let times: Vec<String> = self.written.iter().map(|(stamp, _)| stamp.to_string()).collect();
        let n_overlapping =
            self.written.windows(2).filter(|pair| pair[0].0 + i64::from(pair[0].1) > pair[1].0).count() as u64;
        let mut report = vec![format!("imported: {n_sweeps} sweeps from {topic}")];
        report.push(match (decision.form, &fields.time) {
            (Some(form), Some(name)) => format!("point times: field {name}, {}", form.text()),
            (None, Some(name)) => {
                format!("no point times: field {name} does not span 5 ms to 0.5 s in s, ms, us or ns; sweeps begin at the stamps")
            }
            (_, None) => "no point times: the clouds have no such field; sweeps begin at the stamps".to_owned(),
        });
        report.push(match (&decision.rings, &fields.ring) {
            (Some(rings), Some(name)) => {
                format!("rings: field {name}, {} beams counted {}", rings.n_rings(), rings.order)
            }
            (None, Some(name)) => {
                let limit = self.model.map_or(String::new(), |model| format!(" of a {}", model.name()));
                format!("no rings: field {name} does not number the beams{limit}, each of one elevation")
            }
            (_, None) => "no rings: the clouds have no such field".to_owned(),
        });
        if self.model.is_none() {
            let model = decision.model.name();
            report.push(format!("clouds do not name the LiDAR: {model} is assumed, --model sets another"));
        }
        let Counts { empty, same_stamp, bad_times, without_ring } = self.counts;
        for (n, what) in [
            (empty, "clouds without points are left out"),
            (same_stamp, "clouds with the stamp of another are left out"),
            (bad_times, "clouds whose times span more than 0.5 s are left out"),
            (n_overlapping, "sweeps end after the next one begins"),
            (without_ring, "points of unknown beams are left out"),
        ] {
            if n > 0 {
                report.push(format!("{n} {what}"));
            }
        }
        let file = TextFile { place: Path::new(place).join(TIMES_FILE), text: times.join("\n") + "\n" };
        Ok(FinishedSweeps { model: decision.model, origin: decision.origin, times: file, report })
    }
}

impl Cloud {
    /// Origin of map coordinates.
    fn origin(&self) -> Result<Option<MapOrigin>, String> {
        let positions = self.points.iter().map(|point| point.position).collect();
        let cloud = RawCloud {
            positions,
            position_type: self.position_type,
            intensities: None,
            beams: None,
            times: None,
            viewpoint: None,
            flags: PointFlags::default(),
        };
        cloud.map_origin().map_err(|fault| fault.to_string())
    }
}

/// A position after the origin of the map is subtracted.
fn relative(position: [f64; 3], origin: Option<MapOrigin>) -> [f32; 3] {
    let MapOrigin(origin) = origin.unwrap_or(MapOrigin([0; 3]));
    [0, 1, 2].map(|axis| (position[axis] - origin[axis] as f64) as f32)
}

/// Names of the fields of the clouds, for the report, and their rows.
#[derive(Clone, Debug, Default)]
pub(crate) struct FieldNames {
    pub time: Option<String>,
    pub ring: Option<String>,
    pub n_rows: u32,
}

fn is_return(point: &RawPoint) -> bool {
    let [x, y, z] = point.position.map(|value| value as f32);
    let range_m = (x * x + y * y + z * z).sqrt();
    range_m.is_finite() && range_m > MIN_RANGE_M
}

/// Smallest and largest time.
fn time_range(cloud: &Cloud) -> Option<[f64; 2]> {
    let times = || cloud.points.iter().filter_map(|point| point.time);
    Some([times().reduce(f64::min)?, times().reduce(f64::max)?])
}
