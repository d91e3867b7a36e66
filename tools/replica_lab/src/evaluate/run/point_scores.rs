//! Counts of the points of all clouds by true and predicted label.

use crate::evaluate::recorded_truth::RecordedTruth;
use crate::true_points::{Labelled, TruePoints};
use anyhow::{Context, bail};
use drive::{Drive, NoLabel};
use formats::ply::Vertices;
use messages::{ClassId, UNSEEN};
use scores::{Confusion, Overlaps, PointLabel};
use std::collections::BTreeMap;
use std::path::Path;

/// Source of true labels.
pub enum TrueLabels {
    /// Sweeps of a drive.
    Drive(Box<TruePoints>),
    /// Submaps of an imported recording.
    Recording(Box<RecordedTruth>),
}

/// Counts, cloud by cloud.
pub struct PointScores {
    truth: TrueLabels,
    /// Points of all clouds.
    pub n_points: u64,
    /// Points that are returns of sweeps without labels; they are neither scored nor counted as missing.
    pub n_in_unlabeled: u64,
    /// Points that are returns of the drive.
    pub n_joined: u64,
    /// Points that are not returns of the drive, by reason: no sweep, no return, another return.
    pub n_apart: [u64; 3],
    /// Joined points whose true class is unlabeled; they are not scored.
    pub n_unlabeled: u64,
    /// Points of clouds without classes, without instances, without colors.
    pub n_without: [u64; 3],
    /// True and predicted classes.
    pub confusion: Confusion,
    /// True and predicted instances.
    pub overlaps: Overlaps,
    /// Points by the camera that colored them.
    pub colored_by: BTreeMap<u8, u64>,
    /// Times of the points, s.
    times_s: Option<[f64; 2]>,
}

/// Texts of [`PointScores::n_apart`].
pub const REASONS: [&str; 3] = [
    "outside the labeled sweeps of the drive",
    "no return of the ring at this time",
    "the return at this time has another angle or range",
];

impl PointScores {
    /// Scores without points.
    pub fn new(truth: TrueLabels) -> Self {
        Self {
            truth,
            n_points: 0,
            n_in_unlabeled: 0,
            n_joined: 0,
            n_apart: [0; 3],
            n_unlabeled: 0,
            n_without: [0; 3],
            confusion: Confusion::new(ClassId::ALL.len()),
            overlaps: Overlaps::default(),
            colored_by: BTreeMap::new(),
            times_s: None,
        }
    }

    /// Adds the points of a cloud.
    pub fn add(&mut self, cloud: &Vertices) -> anyhow::Result<()> {
        let truth = self.truth.labels_of(cloud)?;
        for time_s in cloud.f64s("timestamp")?.into_iter().filter(|time_s| time_s.is_finite()) {
            let [first, last] = self.times_s.get_or_insert([time_s; 2]);
            *first = first.min(time_s);
            *last = last.max(time_s);
        }
        self.n_points += truth.len() as u64;
        for label in &truth {
            self.count(*label);
        }
        let has = |name: &str| cloud.has(name);
        let missing = [!has("semantic"), !has("semantic") || !has("instance"), !has("camera")];
        for (n, _) in self.n_without.iter_mut().zip(missing).filter(|(_, is_missing)| *is_missing) {
            *n += truth.len() as u64;
        }
        if has("semantic") {
            self.add_labels(cloud, &truth)?;
        }
        if has("camera") {
            for camera in cloud.u8s("camera")?.into_iter().filter(|camera| *camera != UNSEEN) {
                *self.colored_by.entry(camera).or_default() += 1;
            }
        }
        Ok(())
    }

    fn count(&mut self, label: Labelled) {
        match label {
            Ok(label) => {
                self.n_joined += 1;
                self.n_unlabeled += u64::from(class_of(label) == ClassId::Unlabeled as u8);
            }
            Err(NoLabel::NoSweep) => self.n_apart[0] += 1,
            Err(NoLabel::NoReturn) => self.n_apart[1] += 1,
            Err(NoLabel::OtherReturn) => self.n_apart[2] += 1,
            Err(NoLabel::UnlabeledSweep) => self.n_in_unlabeled += 1,
        }
    }

    fn add_labels(&mut self, cloud: &Vertices, truth: &[Labelled]) -> anyhow::Result<()> {
        let classes = cloud.u8s("semantic")?;
        if let Some(i) = classes.iter().position(|class| ClassId::from_id(*class).is_none()) {
            bail!("semantic of point {i} is {}; must be 0 to {}", classes[i], ClassId::ALL.len() - 1);
        }
        let instances = cloud.has("instance").then(|| cloud.i64s("instance")).transpose()?;
        for (i, (label, class)) in truth.iter().zip(classes).enumerate() {
            let Ok(label) = label else { continue };
            let true_class = class_of(*label);
            if true_class != ClassId::Unlabeled as u8 {
                self.confusion.add(usize::from(true_class), usize::from(class));
            }
            let Some(instances) = &instances else { continue };
            let instance = u32::try_from(instances[i])
                .with_context(|| format!("instance of point {i} is {}; must be 0 to 2^32 - 1", instances[i]))?;
            let truth = PointLabel { class: true_class, instance: label.instance };
            self.overlaps.add(truth, PointLabel { class, instance });
        }
        Ok(())
    }

    /// Share of the points that are returns of the drive, also of its unlabeled sweeps.
    pub fn share_of_drive(&self) -> f64 {
        (self.n_joined + self.n_in_unlabeled) as f64 / self.n_points.max(1) as f64
    }

    /// Share of the points outside of unlabeled sweeps that are returns of the drive.
    pub fn share_joined(&self) -> f64 {
        self.n_joined as f64 / (self.n_points - self.n_in_unlabeled).max(1) as f64
    }

    /// Numbers of the sweeps without labels and of all sweeps of the run.
    pub fn unlabeled_sweeps(&self) -> [u64; 2] {
        match &self.truth {
            TrueLabels::Drive(points) => points.unlabeled_sweeps(),
            TrueLabels::Recording(_) => [0; 2],
        }
    }

    /// Explains why the run belongs to another drive.
    pub fn mismatch(&self, truth: &Path) -> String {
        let reasons = REASONS.iter().zip(self.n_apart).filter(|(_, n)| *n > 0);
        let reasons: Vec<String> = reasons.map(|(reason, n)| format!("{n} {reason}")).collect();
        let span = |stamps: Option<[f64; 2]>| {
            stamps.map_or_else(|| "none".to_owned(), |[first, last]| format!("{first:.3} to {last:.3} s"))
        };
        let sweeps = match &self.truth {
            TrueLabels::Drive(points) => points.stamps_read(),
            TrueLabels::Recording(_) => None,
        };
        let sweeps = sweeps.map(|stamps| stamps.map(|stamp| stamp as f64 * 1e-9));
        format!(
            "only {} of {} points are returns of {} ({}); times of the points: {}, of its sweeps so far: {}",
            self.n_joined + self.n_in_unlabeled,
            self.n_points,
            truth.display(),
            reasons.join(", "),
            span(self.times_s),
            span(sweeps),
        )
    }
}

impl TrueLabels {
    /// The labels of a drive.
    pub fn from_drive(drive: Drive) -> anyhow::Result<Self> {
        Ok(Self::Drive(Box::new(TruePoints::open(drive)?)))
    }

    fn labels_of(&mut self, cloud: &Vertices) -> anyhow::Result<Vec<Labelled>> {
        match self {
            Self::Drive(points) => points.labels_of(cloud),
            Self::Recording(recording) => recording.labels_of(cloud),
        }
    }
}

/// The class of a label; ids beyond the class table are unlabeled.
fn class_of(label: PointLabel) -> u8 {
    ClassId::from_id(label.class).unwrap_or(ClassId::Unlabeled) as u8
}
