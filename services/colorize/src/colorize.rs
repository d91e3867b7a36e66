//! The stage: what comes, what is held, what is due.

use crate::Settings;
use crate::choose::{Limits, Sources};
use crate::chunk::{Chunk, Cloud};
use crate::color::{Picture, color_into};
use crate::occlusion::sights;
use crate::offset::{Look, Profile};
use crate::offset_watch::{look, sentence};
use crate::saved::{self, Held};
use crate::spectra::{Bands, CameraCubes, CubePicture, Found};
use crate::views::Camera;
use crate::window::{Exposure, Window};
use formats::drive::Drive;
use formats::manifest::MosaicEntry;
use formats::sensor_calibration::SensorCalibration;
use geometry::{Pose, Stamp};
use messages::{Color, Cube, Image, Spectra, Submap, SubmapHeader, Trajectory, UNSEEN};
use stage::{Context, Flow, Inputs, Outputs, Port, Received, Stage, StepError};

/// Submaps between two ticks; see the crate's documentation.
const MAX_HELD: usize = 1;

/// An exposure may come this much later than the poses around it, ns. Far above a revolution of any LiDAR.
const MAX_LATENESS_NANOS: i64 = 2_000_000_000;

/// Times beside an exposure between which its view is said to move, ns: far more than the pose's own noise, far less than a turn.
const BESIDE_NANOS: i64 = 20_000_000;

/// The stage.
pub struct Colorize {
    max_age_nanos: i64,
    limits: Limits,
    cameras: Vec<Camera>,
    mosaics: Vec<Camera>,
    /// Of each mosaic camera the side of its filter pattern, px, and the bands that its cubes are expected to have.
    patterns: Vec<u32>,
    expected_nm: Vec<Vec<f32>>,
    /// What the bands really are: as expected, until a camera's first cube says otherwise.
    bands: Bands,
    /// Whether exposures may come at all; if not, submaps need not wait for them.
    sees: bool,
    remark: Option<&'static str>,
    /// Of the cameras.
    names: Vec<String>,
    max_offset_rad: f32,
    max_delay_s: f32,
    held: Held,
    /// Memory that every submap uses again: the system takes as long to give such memory as coloring does.
    chunks: Vec<Chunk>,
}

impl Colorize {
    fn with_drive(settings: &Settings, drive: &Drive, context: &Context) -> Result<Self, StepError> {
        let (rig, manifest) = (drive.rig(), drive.manifest());
        let (n_cameras, n_mosaics) = (rig.cameras.len(), rig.mosaics.len());
        if n_cameras.max(n_mosaics) > usize::from(UNSEEN) {
            let text = format!("{n_cameras} cameras and {n_mosaics} mosaic cameras; must be {UNSEEN} of each at most");
            return Err(StepError::data(text));
        }
        let expected_nm: Vec<Vec<f32>> = manifest
            .mosaics
            .iter()
            .zip(drive.sensors())
            .map(|(entry, sensor)| expected_nm(entry, sensor.as_ref()))
            .collect();
        let bands = Bands::new(&expected_nm).ok_or_else(|| too_many_bands(&expected_nm))?;
        let (images, cubes) = (context.is_connected::<Image>(), context.is_connected::<Cube>());
        Ok(Self {
            max_age_nanos: (settings.max_age_s * 1e9).round() as i64,
            limits: Limits {
                max_age_s: settings.max_age_s as f32,
                max_moving_age_s: settings.max_moving_age_s.min(settings.max_age_s) as f32,
            },
            cameras: rig.cameras.iter().map(Camera::from).collect(),
            mosaics: rig.mosaics.iter().map(Camera::from).collect(),
            patterns: manifest.mosaics.iter().map(|entry| entry.pattern).collect(),
            expected_nm,
            bands,
            sees: (images && n_cameras > 0) || (cubes && n_mosaics > 0),
            remark: match (n_cameras, images) {
                (0, _) => Some("no cameras in this drive: points stay without color"),
                (_, false) => Some("nobody publishes images: points stay without color"),
                _ => None,
            },
            names: manifest.cameras.iter().map(|entry| entry.name.clone()).collect(),
            max_offset_rad: (settings.max_offset_mrad * 1e-3) as f32,
            max_delay_s: (settings.max_delay_ms * 1e-3) as f32,
            held: Held::default(),
            chunks: Vec::new(),
        })
    }

    fn take_poses(&mut self, inputs: &mut Inputs) -> Result<(), StepError> {
        for message in inputs.take::<Trajectory>() {
            for row in message.rows() {
                let pose = row.world_from_body.to_pose().ok_or_else(|| {
                    StepError::data(format!("trajectory: {row:?} is no pose (finite, unit quaternion x y z w)"))
                })?;
                if !self.held.trajectory.push(Stamp(row.stamp), pose) {
                    let text = format!("trajectory: pose at {} ns is older than the one before it", row.stamp);
                    return Err(StepError::data(text));
                }
            }
        }
        Ok(())
    }

    fn take_exposures(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) {
        for image in inputs.take::<Image>() {
            if self.picture(&image).is_some() {
                self.held.images.add(image);
            } else {
                let header = image.header();
                outputs.count("images_unusable", 1);
                outputs.note(format!(
                    "images of camera {} with {}x{} px and {} channels do not fit the rig: not used",
                    header.camera, header.width, header.height, header.channels
                ));
            }
        }
        for cube in inputs.take::<Cube>() {
            if self.cube_picture(&cube).is_some() && self.has_expected_bands(&cube) {
                self.held.cubes.add(cube);
            } else {
                let header = cube.header();
                outputs.count("cubes_unusable", 1);
                outputs.note(format!(
                    "cubes of mosaic camera {} with {}x{} cells of {} bands do not fit the rig: not used",
                    header.camera, header.width, header.height, header.n_bands
                ));
            }
        }
    }

    /// The image, if it is one of the rig's.
    fn picture<'a>(&self, image: &'a Received<Image>) -> Option<Picture<'a>> {
        let header = image.header();
        let camera = self.cameras.get(header.camera as usize)?;
        let fits = camera.size() == [header.width, header.height] && header.channels == 3;
        Picture::new(header.camera as u8, header.width, header.height, image.rows()).filter(|_| fits)
    }

    /// The cube, if it is one of the rig's.
    fn cube_picture<'a>(&self, cube: &'a Received<Cube>) -> Option<CubePicture<'a>> {
        let header = cube.header();
        let camera = header.camera as usize;
        let [width, height] = self.mosaics.get(camera)?.size().map(u64::from);
        let end = |first: u32, n_cells: u32| u64::from(first) + u64::from(n_cells) * u64::from(header.pattern);
        let fits = end(header.x0, header.width) <= width
            && end(header.y0, header.height) <= height
            && (header.pattern == self.patterns[camera] || header.pattern == 1);
        CubePicture::new(header, cube.rows()).filter(|_| fits)
    }

    /// Whether the cube has the bands of its camera. The first one of a camera says what they are: whether cubes are
    /// corrected is calibrate's affair.
    fn has_expected_bands(&mut self, cube: &Received<Cube>) -> bool {
        let header = cube.header();
        let Some(wavelengths_nm) = header.wavelengths_nm.get(..header.n_bands as usize) else { return false };
        if let Some(known) = self.held.bands_nm.get(&header.camera) {
            return known == wavelengths_nm;
        }
        self.held.bands_nm.insert(header.camera, wavelengths_nm.to_vec());
        if let Ok(bands) = self.known_bands() {
            self.bands = bands;
            return true;
        }
        self.held.bands_nm.remove(&header.camera);
        false
    }

    /// The bands of all cameras: of those whose cubes have come theirs, of others those that are expected.
    fn known_bands(&self) -> Result<Bands, StepError> {
        let mut wavelengths_nm = self.expected_nm.clone();
        for (camera, bands_nm) in &self.held.bands_nm {
            if let Some(slot) = wavelengths_nm.get_mut(*camera as usize) {
                slot.clone_from(bands_nm);
            }
        }
        Bands::new(&wavelengths_nm).ok_or_else(|| too_many_bands(&wavelengths_nm))
    }

    /// Whether all exposures that the submap may need have come.
    fn is_complete(&self, submap: &Received<Submap>) -> bool {
        let newest_pose = self.held.trajectory.poses().last();
        let until = submap.header().stamp_end.saturating_add(self.max_age_nanos);
        !self.sees || newest_pose.is_some_and(|(stamp, _)| stamp.0 >= until)
    }

    /// The oldest submap, if its time has come.
    fn next_due(&mut self, outputs: &mut Outputs) -> Option<Received<Submap>> {
        let is_complete = self.is_complete(self.held.submaps.front()?);
        if !is_complete {
            if self.held.submaps.len() <= MAX_HELD {
                return None;
            }
            outputs.count("submaps_colored_early", 1);
        }
        self.held.submaps.pop_front()
    }

    fn publish_columns(&mut self, submap: &Received<Submap>, outputs: &mut Outputs) -> Result<(), StepError> {
        if let Some(remark) = self.remark {
            outputs.note(remark);
        }
        let header = submap.header();
        let world_from_submap = header.world_from_submap.to_pose().ok_or_else(|| {
            StepError::data(format!(
                "submap {}: world_from_submap {:?} is no pose",
                submap.seq(),
                header.world_from_submap
            ))
        })?;
        let sweeps = header.sweeps.get(..header.n_sweeps as usize).ok_or_else(|| {
            StepError::data(format!(
                "submap {}: {} sweeps; must be {} at most",
                submap.seq(),
                header.n_sweeps,
                header.sweeps.len()
            ))
        })?;
        let mut chunks = std::mem::take(&mut self.chunks);
        let cloud = Cloud::new(submap.rows(), sweeps, header.stamp_begin, header.n_rings, &mut chunks);
        let profiles = self.publish_color(submap, &cloud, &world_from_submap, outputs)?;
        self.held.watch.keep(profiles);
        self.publish_spectra(submap, &cloud, &world_from_submap, outputs)?;
        self.chunks = chunks;
        Ok(())
    }

    /// Gives what the images show at the edges of the points, too.
    fn publish_color(
        &self,
        submap: &Received<Submap>,
        cloud: &Cloud<'_>,
        world_from_submap: &Pose,
        outputs: &mut Outputs,
    ) -> Result<Vec<(usize, Vec<Profile>)>, StepError> {
        let (mut views, mut pictures, mut beside) = (Vec::new(), Vec::new(), Vec::new());
        for (image, world_from_body) in self.within_reach(&self.held.images, submap.header(), outputs) {
            let Some(picture) = self.picture(image) else { continue };
            let camera = &self.cameras[image.header().camera as usize];
            views.push(camera.view(image.stamp(), &world_from_body, world_from_submap));
            pictures.push(picture);
            beside.push([-BESIDE_NANOS, BESIDE_NANOS].map(|nanos| {
                let stamp = image.stamp().saturating_add(nanos);
                Some(camera.view(stamp, &self.held.trajectory.at(Stamp(stamp))?, world_from_submap))
            }));
        }
        let sights = sights(cloud, &views);
        let sources = Sources { cloud, views: &views, sights: &sights, limits: self.limits };
        let n_points = cloud.points.len();
        let mut loan = outputs.loan::<Color>(n_points)?;
        let rows = loan.grow_unset(n_points).ok_or_else(|| too_small("color", n_points))?;
        let n_seen = color_into(&sources, &pictures, rows);
        loan.header_mut().n_seen = n_seen;
        outputs.count("points", n_points as u64);
        outputs.count("points_with_color", n_seen);
        outputs.publish_column(loan, submap.stamp(), submap.seq())?;

        let header = submap.header();
        let places = (0..views.len()).filter(|i| {
            let is_within = (header.stamp_begin..=header.stamp_end).contains(&views[*i].stamp);
            is_within && !self.held.watch.has_enough_of(pictures[*i].camera())
        });
        let looks = places.filter_map(|i| {
            let [before, after] = beside[i];
            let beside_s = 2e-9 * BESIDE_NANOS as f32;
            let (view, sight, picture) = (views[i], &sights[i], pictures[i]);
            Some((picture.camera(), Look { view, beside: [before?, after?], beside_s, sight, picture }))
        });
        Ok(look(cloud, &looks.collect::<Vec<_>>()))
    }

    /// Says how far points and images are apart.
    fn report_offset(&self, outputs: &mut Outputs) {
        let offset = self.held.watch.offset();
        for (index, found) in offset.cameras.iter().enumerate().filter(|(_, found)| found.is_found()) {
            outputs.count("cameras_with_known_offset", 1);
            let is_far = found.exceeds(self.max_offset_rad);
            outputs.count("cameras_with_large_offset", u64::from(is_far));
            if is_far {
                let by_range = self.held.watch.by_range(index, &offset);
                outputs.note(sentence(&self.names[index], self.cameras[index].px_per_rad(), found, &by_range));
            }
        }
        if let Some([delay_s, deviation_s]) =
            offset.delay_s.filter(|[delay_s, sigma_s]| delay_s.abs() - 3.0 * sigma_s > self.max_delay_s)
        {
            outputs.note(format!(
                "images were taken {:.1} +- {:.1} ms after their stamps",
                1e3 * delay_s,
                1e3 * deviation_s
            ));
        }
    }

    fn publish_spectra(
        &self,
        submap: &Received<Submap>,
        cloud: &Cloud<'_>,
        world_from_submap: &Pose,
        outputs: &mut Outputs,
    ) -> Result<(), StepError> {
        let mut cameras: Vec<CameraCubes<'_>> = Vec::new();
        cameras.resize_with(self.mosaics.len(), CameraCubes::default);
        for (cube, world_from_body) in self.within_reach(&self.held.cubes, submap.header(), outputs) {
            let Some(picture) = self.cube_picture(cube) else { continue };
            let header = cube.header();
            let index = header.camera as usize;
            let area = [header.x0, header.y0, header.width * header.pattern, header.height * header.pattern];
            let view = self.mosaics[index].view_of_area(cube.stamp(), &world_from_body, world_from_submap, area);
            cameras[index].views.push(view);
            cameras[index].cubes.push(picture);
        }
        let found = Found::new(cloud, &self.bands, &cameras, self.limits);
        let mut loan = outputs.loan::<Spectra>(found.n_rows())?;
        *loan.header_mut() = found.header();
        found.write_into(loan.grow_unset(found.n_rows()).ok_or_else(|| too_small("spectra", found.n_rows()))?);
        outputs.count("points_with_spectrum", found.n_spectra() as u64);
        outputs.publish_column(loan, submap.stamp(), submap.seq())
    }

    /// The exposures near enough in time to some point of the submap, with `world_from_body`. Those before the first or
    /// after the last known pose are left out, and counted once for every submap that they might have served.
    fn within_reach<'a, T: Exposure>(
        &self,
        window: &'a Window<T>,
        header: &SubmapHeader,
        outputs: &mut Outputs,
    ) -> Vec<(&'a Received<T>, Pose)> {
        let from = header.stamp_begin.saturating_sub(self.max_age_nanos);
        let until = header.stamp_end.saturating_add(self.max_age_nanos);
        let near = window.exposures().iter().filter(|exposure| (from..=until).contains(&exposure.stamp()));
        let posed = |exposure: &'a Received<T>| Some((exposure, self.held.trajectory.at(Stamp(exposure.stamp()))?));
        let n_near = near.clone().count();
        let found: Vec<_> = near.filter_map(posed).collect();
        outputs.count("exposures_without_pose", (n_near - found.len()) as u64);
        found
    }

    /// Lets go of what no held or future submap needs.
    fn release(&mut self, outputs: &mut Outputs) {
        let held = &mut self.held;
        // The points of future submaps come after those of the newest.
        let oldest = held.submaps.front().map(|submap| submap.header().stamp_begin);
        if let Some(needed_from) = oldest.min(held.submaps_until).or(held.submaps_until) {
            let needed_from = needed_from.saturating_sub(self.max_age_nanos);
            held.images.release_before(needed_from);
            held.cubes.release_before(needed_from);
        }
        let n_excess = held.images.release_excess() + held.cubes.release_excess();
        outputs.count("exposures_released_early", n_excess);
        if let Some((newest, _)) = held.trajectory.poses().last() {
            let exposures = [oldest_stamp(&held.images), oldest_stamp(&held.cubes)];
            let late = newest.0.saturating_sub(MAX_LATENESS_NANOS);
            let needed_from = exposures.into_iter().flatten().fold(late, i64::min);
            held.trajectory.forget_before(Stamp(needed_from));
        }
    }
}

fn oldest_stamp<T: Exposure>(window: &Window<T>) -> Option<i64> {
    window.exposures().first().map(Received::stamp)
}

/// Virtual bands where the camera's calibration has some, because calibrate corrects by default; else the filters'.
fn expected_nm(entry: &MosaicEntry, sensor: Option<&SensorCalibration>) -> Vec<f32> {
    match sensor.and_then(SensorCalibration::reflectance_matrix) {
        Some(matrix) => matrix.virtual_bands.iter().map(|band| band.wavelength_nm as f32).collect(),
        None => entry.wavelengths_nm.iter().map(|nm| *nm as f32).collect(),
    }
}

fn too_many_bands(wavelengths_nm: &[Vec<f32>]) -> StepError {
    let n_bands: usize = wavelengths_nm.iter().map(Vec::len).sum();
    StepError::data(format!("{n_bands} bands in all; must be {} at most", messages::MAX_BANDS))
}

fn too_small(topic: &str, n_rows: usize) -> StepError {
    StepError::Contract(format!("{topic}: the loan does not hold the {n_rows} rows that were asked for"))
}

impl Stage for Colorize {
    const NAME: &'static str = "colorize";
    type Settings = Settings;

    fn inputs() -> Vec<Port> {
        vec![Port::of::<Submap>(), Port::of::<Trajectory>(), Port::optional::<Image>(), Port::optional::<Cube>()]
    }

    fn outputs() -> Vec<Port> {
        vec![Port::of::<Color>(), Port::of::<Spectra>()]
    }

    fn new(settings: &Settings, context: &Context) -> Result<Self, StepError> {
        let drive = Drive::open(&context.drive).map_err(StepError::io)?;
        Self::with_drive(settings, &drive, context)
    }

    fn step(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError> {
        self.take_poses(inputs)?;
        self.take_exposures(inputs, outputs);
        for submap in inputs.take::<Submap>() {
            self.held.submaps_until = self.held.submaps_until.max(Some(submap.header().stamp_end));
            self.held.submaps.push_back(submap);
        }
        while let Some(submap) = self.next_due(outputs) {
            self.publish_columns(&submap, outputs)?;
        }
        self.release(outputs);
        Ok(Flow::Continue)
    }

    fn finish(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        while let Some(submap) = self.held.submaps.pop_front() {
            self.publish_columns(&submap, outputs)?;
        }
        self.report_offset(outputs);
        Ok(())
    }

    fn save(&mut self) -> Result<Vec<u8>, StepError> {
        saved::save(&self.held)
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        self.held = saved::load(state)?;
        self.bands = self.known_bands()?;
        Ok(())
    }
}
