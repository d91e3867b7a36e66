//! `infer`: gives every point of a submap a class and a score, with the model file of the settings.
//!
//! | topic | direction | content |
//! |---|---|---|
//! | `submap` | in | points and sweeps |
//! | `color`, `spectra` | in, if the model reads them | columns of the submap |
//! | `class` | out | class and score of every point, in the order of the submap |
//!
//! The model file names its architecture (crate `segmentation`) and the columns that it reads in addition to the
//! points. A submap waits only for those columns; without columns, the stage keeps no state between ticks. With the
//! feature `cuda`, networks on images can run on an NVIDIA GPU.
//!
//! This stage binds a [`Segmenter`] to topics, settings and counters. It must never compute a class itself, change the
//! order or number of points, or drop a submap: a point that the model cannot classify is `unlabeled`. The doubts about
//! the classes are decided at the end, from counters only.
//!
//! Start at `Infer::step` and `Infer::label`; `cameras.rs` checks before the start that the drive provides the columns
//! that the model reads. `docs/explanation/segmentation.md` explains the method.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod cameras;

use doubts::Doubt;
use messages::{CLASS_TABLE_VERSION, ClassHeader, ClassTopic, ColorTopic, SpectraTopic, SubmapTopic};
use segmentation::intensity::{ForeignIntensity, IntensityUse};
use segmentation::spherical::AskedColumns;
use segmentation::{
    ComputeDevice, LidarAboveGround, ModelInput, MountingFault, Options, Refinement, Report, Segmenter, SpectraColumn,
    UnknownBelow,
};
use stage::{
    Context, Flow, Inputs, JoinedSubmap, Outputs, Port, Problem, Received, SavedColumn, Stage, StateBytes, StepError,
    SubmapJoin, decode_head, find_file,
};
use std::path::Path;

stage::settings! {
    /// Settings of infer.
    pub struct Settings {
        /// Model file. A relative path is relative to the folder of launch.toml.
        pub model: String = "models/street_fused.safetensors".to_owned() => stage::any();
        /// One of this many sweeps of a submap goes through a network on images; points of the other sweeps get the
        /// votes of nearby points. 1 is all sweeps. A fused model multiplies it by its own number.
        pub every: u32 = 1 => stage::within(1, 16);
        /// Use of the intensities by the model: `raw` as recorded, `normalized` scaled ring by ring to the training
        /// with the ground as reference, `off` unused, `auto` as recorded, but normalized where the scale differs, and unused
        /// where the ground has only a few different ones.
        pub intensity: IntensityUse = IntensityUse::Auto => stage::one_word();
        /// Device of the network: `cpu`, or `cuda` for the first NVIDIA GPU. `cuda` needs a program built with `cargo
        /// build --release -p infer -p replica_lab --features cuda`. Its sums are rounded differently, so some classes
        /// can differ from the CPU's.
        pub device: ComputeDevice = ComputeDevice::Cpu => stage::one_word();
        /// Sweeps that go through the network together: in parallel on a CPU, as one tensor on a GPU. On a CPU, every value uses all
        /// threads and gives the same classes; larger values need more memory.
        pub batch: u32 = 1 => stage::within(1, 64);
        /// Number of views of a submap that vote on the classes: 1 is the submap itself, then two tilted by 3 degrees, a smaller,
        /// a larger and a mirrored copy. Each view takes as much CPU time as the submap; classes and scores become more accurate.
        pub views: u32 = 1 => stage::within(1, segmentation::MOST_VIEWS as u32);
        /// Score below which a point gets the class `unlabeled`, 0 to 1. It keeps its score. The counter
        /// `unknown_points` has the number of these points. 0 keeps every class. `replica-lab evaluate classes` prints
        /// how many points a threshold keeps, and how many of the kept points are correct.
        pub unknown_below: f64 = 0.0 => stage::within(0.0, 1.0);
        /// Relabel terrain and unpaved ground as vegetation where the ground is rough: low vegetation is as low, but
        /// rougher.
        pub rough_ground: bool = true => stage::any();
        /// Give clusters of vehicle points their second class if nothing in them is 0.6 m above the ground, or if they have
        /// fewer than 10 points: no vehicle looks like this.
        pub vehicle_shape: bool = true => stage::any();
        /// The ground below the path is road: kinds of ground that the model sees there instead become less probable in the whole
        /// submap. Turn it off for drives over fields and on pavements.
        pub driven_is_road: bool = true => stage::any();
        /// Correction of the thesis (section 6.3.2): upright narrow objects in the depth image become poles, other poles lose their
        /// class. For models on range images.
        pub thin_poles: bool = false => stage::any();
        /// Correction of the thesis: regions of buildings and vegetation with fewer than 100 pixels get the surrounding class. For
        /// models on range images.
        pub small_regions: bool = false => stage::any();
        /// Correction of the thesis: objects above 2.5 m that are long in the top view become buildings.
        pub long_buildings: bool = false => stage::any();
        /// Share of points that the model cannot classify, above which the classes are doubtful. Some returns are
        /// beyond the range of the model; a fifth of all points indicates a LiDAR or a mounting that does not suit the
        /// model.
        pub max_unseen_share: f64 = 0.2 => stage::within(0.0, 1.0);
        /// Share of submaps that are too wide for the grid of the model, above which the classes are doubtful: enlarged cells
        /// miss kerbs and thin objects. One submap in ten may contain a far outlier.
        pub max_coarsened_share: f64 = 0.1 => stage::within(0.0, 1.0);
        /// Share of submaps in which the LiDAR is not above the ground as on a vehicle, above which the classes are
        /// doubtful: no ground near the path or on it, a height outside 0.7 to 4 m, or ground steeper than any street. A
        /// wrong mounting affects all submaps.
        pub max_misplaced_share: f64 = 0.5 => stage::within(0.0, 1.0);
        /// Share of submaps whose intensities are on another scale than in training, above which the classes are
        /// doubtful. One in ten may be a square of white stone.
        pub max_foreign_intensity_share: f64 = 0.1 => stage::within(0.0, 1.0);
    }
}

/// Version of the saved state of a model with colors or spectra.
const STATE_VERSION: u32 = 1;

/// The stage.
pub struct Infer {
    /// Joins submaps with the columns that the model reads; `None` if it reads no columns.
    join: Option<SubmapJoin>,
    model: Box<dyn Segmenter>,
    /// What users of the model must know.
    notices: Vec<String>,
    /// Whether points with a low score lose their class.
    has_unknown: bool,
    max_unseen_share: f64,
    max_coarsened_share: f64,
    max_misplaced_share: f64,
    max_foreign_intensity_share: f64,
    /// Treatment of intensities on another scale.
    intensity_use: &'static str,
}

impl Infer {
    /// Publishes the class column of one submap.
    fn label(
        &self,
        submap: &Received<SubmapTopic>,
        input: &ModelInput<'_>,
        outputs: &mut Outputs,
    ) -> Result<(), StepError> {
        let n_points = input.points.len();
        let mut loan = outputs.loan::<ClassTopic>(n_points)?;
        *loan.header_mut() =
            ClassHeader { class_table_version: CLASS_TABLE_VERSION, model_digest: self.model.card().digest };
        let classes = loan.grow(n_points)?;
        let report = self.model.segment(input, classes).map_err(StepError::data)?;
        outputs.publish_column(loan, submap.stamp(), submap.seq())?;
        outputs.count("submaps", 1);
        outputs.count("points", n_points as u64);
        if self.has_unknown {
            outputs.count("unknown_points", report.n_unknown as u64);
        }
        count(report, outputs);
        Ok(())
    }

    /// [`Self::label`] for a submap with its columns. Live, a lost column leaves its points without colors or spectra.
    fn label_joined(&self, joined: &JoinedSubmap, outputs: &mut Outputs) -> Result<(), StepError> {
        let submap = &joined.submap;
        let spectra = joined.column::<SpectraTopic>();
        let spectra = spectra.map(|column| SpectraColumn { header: column.header(), rows: column.rows() });
        let colors = joined.rows::<ColorTopic>()?;
        for topic in &joined.lost {
            outputs.count(&format!("submaps_without_{topic}"), 1);
        }
        let input = ModelInput { colors, spectra, ..ModelInput::new(submap.header(), submap.rows()) };
        self.label(submap, &input, outputs)
    }

    fn report_doubts(&self, outputs: &mut Outputs) {
        let share = |n: u64, of: u64| n as f64 / of.max(1) as f64;
        let n_submaps = outputs.counted("submaps");
        let unseen = share(outputs.counted("points_unseen"), outputs.counted("points"));
        let limit = self.max_unseen_share;
        if unseen > limit {
            outputs.report_doubt(&Doubt::PointsUnseen { share: unseen, limit });
        }
        let n_coarsened = outputs.counted("submaps_coarsened");
        let limit = self.max_coarsened_share;
        if share(n_coarsened, n_submaps) > limit {
            outputs.report_doubt(&Doubt::SubmapsCoarsened { n_coarsened, n_submaps, limit });
        }
        let faults = MountingFault::ALL.map(|fault| (fault, outputs.counted(counter(fault))));
        let n_misplaced: u64 = faults.iter().map(|(_, n)| n).sum();
        let limit = self.max_misplaced_share;
        if share(n_misplaced, n_submaps) > limit {
            let found = faults.iter().filter(|(_, n)| *n > 0).map(|(fault, n)| format!("{fault} in {n}"));
            let found = found.collect::<Vec<_>>().join(", ");
            let bare = share(outputs.counted("path_positions_without_ground"), outputs.counted("path_positions"));
            let of_path = (bare > 0.0).then(|| format!("{:.0} % of the path has no ground", 100.0 * bare));
            let found = [Some(found), of_path].into_iter().flatten().collect::<Vec<_>>().join("; ");
            outputs.report_doubt(&Doubt::LidarMisplaced { n_misplaced, n_submaps, limit, found });
        }
        let n_foreign = outputs.counted("submaps_foreign_intensity");
        let limit = self.max_foreign_intensity_share;
        if share(n_foreign, n_submaps) > limit {
            let treatment = self.intensity_use.to_string();
            outputs.report_doubt(&Doubt::ForeignIntensities { n_foreign, n_submaps, limit, treatment });
        }
    }
}

fn options(settings: &Settings) -> Options {
    Options {
        every: settings.every as usize,
        batch: settings.batch as usize,
        views: settings.views as usize,
        device: settings.device,
        intensity: settings.intensity,
        refinement: Refinement {
            rough_ground: settings.rough_ground,
            vehicle_shape: settings.vehicle_shape,
            driven_is_road: settings.driven_is_road,
            poles: settings.thin_poles,
            small_regions: settings.small_regions,
            buildings: settings.long_buildings,
        },
    }
}

/// The counter of submaps with a fault.
const fn counter(fault: MountingFault) -> &'static str {
    match fault {
        MountingFault::NoGround => "submaps_without_ground",
        MountingFault::Height => "submaps_lidar_height",
        MountingFault::Slope => "submaps_steep_ground",
        MountingFault::OffPath => "submaps_ground_off_path",
    }
}

fn count(report: Report, outputs: &mut Outputs) {
    if let LidarAboveGround::Found { n_directed, n_bare, .. } = report.lidar {
        outputs.count("path_positions", u64::from(n_directed));
        outputs.count("path_positions_without_ground", u64::from(n_bare));
    }
    if let Some(fault) = report.lidar.fault() {
        outputs.count(counter(fault), 1);
    }
    outputs.count("points_unseen", report.n_unseen as u64);
    if report.coarsened > 1 {
        outputs.count("submaps_coarsened", 1);
        outputs.note(format!(
            "grid cells of the model enlarged by a factor of {}: the submap is too wide",
            report.coarsened
        ));
    }
    if let Some(ForeignIntensity { found, trained }) = report.foreign_intensity {
        outputs.count("submaps_foreign_intensity", 1);
        outputs.note(format!("median intensity of the ground {found}; the model was trained with {trained}"));
    }
}

impl Stage for Infer {
    const NAME: &'static str = "infer";
    type Settings = Settings;

    fn inputs() -> Vec<Port> {
        vec![Port::of::<SubmapTopic>(), Port::optional::<ColorTopic>(), Port::optional::<SpectraTopic>()]
    }

    /// The topics that the model reads. A model file that cannot be read is reported by [`Self::check`].
    fn inputs_with(settings: &Settings, launch_folder: &Path) -> Result<Vec<Port>, StepError> {
        let path = find_file(launch_folder, Path::new(&settings.model));
        let columns = segmentation::asked_columns(&path).unwrap_or_default();
        let color = columns.color.then(Port::of::<ColorTopic>);
        let spectra = (!columns.wavelengths_nm.is_empty()).then(Port::of::<SpectraTopic>);
        Ok([Some(Port::of::<SubmapTopic>()), color, spectra].into_iter().flatten().collect())
    }

    fn outputs() -> Vec<Port> {
        vec![Port::of::<ClassTopic>()]
    }

    fn check(settings: &Settings, context: &Context) -> Vec<Problem> {
        let options = options(settings);
        let of_device = options.device.open().err().map(|error| Problem::for_key("device", error.to_string()));
        let on_cpu = Options { device: ComputeDevice::Cpu, ..options };
        let mut problems: Vec<Problem> = of_device.into_iter().collect();
        let path = context.resolve(Path::new(&settings.model));
        let of_model = segmentation::load(&path, &on_cpu).err();
        problems.extend(of_model.map(|error| Problem::for_key("model", error.to_string())));
        problems.extend(cameras::problem(&settings.model, &path, context));
        problems
    }

    fn new(settings: &Settings, context: &Context) -> Result<Self, StepError> {
        let path = context.resolve(Path::new(&settings.model));
        let columns = segmentation::asked_columns(&path).map_err(StepError::io)?;
        let reads_any = columns != AskedColumns::default();
        let join = reads_any.then(|| {
            let join = SubmapJoin::new(context.mode).column::<ColorTopic>(columns.color);
            join.column::<SpectraTopic>(!columns.wavelengths_nm.is_empty())
        });
        let model = segmentation::load(&path, &options(settings)).map_err(StepError::io)?;
        Ok(Self {
            join,
            model: UnknownBelow::wrap(model, settings.unknown_below),
            notices: segmentation::notices(&path).map_err(StepError::io)?,
            has_unknown: settings.unknown_below > 0.0,
            max_unseen_share: settings.max_unseen_share,
            max_coarsened_share: settings.max_coarsened_share,
            max_misplaced_share: settings.max_misplaced_share,
            max_foreign_intensity_share: settings.max_foreign_intensity_share,
            intensity_use: match options(settings).intensity {
                IntensityUse::Auto => {
                    "they were normalized with the ground as reference, or not used if too few of them differ"
                }
                IntensityUse::Normalized => "they were normalized with the ground as reference",
                IntensityUse::Raw => "they were taken as recorded",
                IntensityUse::Off => "they were not used",
            },
        })
    }

    fn step(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError> {
        for notice in self.notices.drain(..) {
            outputs.note(format!("model: {notice}"));
        }
        let Some(join) = &mut self.join else {
            for submap in inputs.take::<SubmapTopic>() {
                self.label(&submap, &ModelInput::new(submap.header(), submap.rows()), outputs)?;
            }
            return Ok(Flow::Continue);
        };
        join.take(inputs)?;
        while let Some(joined) = self.join.as_mut().and_then(SubmapJoin::next_complete) {
            self.label_joined(&joined, outputs)?;
        }
        self.join.as_mut().map_or(Ok(()), SubmapJoin::check_bounds)?;
        Ok(Flow::Continue)
    }

    fn finish(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        while let Some(joined) = self.join.as_mut().and_then(SubmapJoin::take_oldest) {
            self.label_joined(&joined, outputs)?;
        }
        self.report_doubts(outputs);
        Ok(())
    }

    /// Saves no bytes for a model without colors and spectra: any program may replace it.
    fn save(&mut self) -> Result<StateBytes<'_>, StepError> {
        let Some(join) = &self.join else { return Ok(StateBytes::default()) };
        let mut state = StateBytes::with_head(STATE_VERSION, &join.save())?;
        join.save_messages(&mut state);
        Ok(state)
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        let Some(join) = &mut self.join else {
            let text = "a model that reads no colors and spectra cannot load the state of one that does";
            return Err(StepError::data(text));
        };
        let (saved, messages): (Vec<SavedColumn>, _) = decode_head(STATE_VERSION, state)?;
        join.load(&saved, messages)
    }
}
