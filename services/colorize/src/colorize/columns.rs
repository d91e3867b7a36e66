//! Output: the columns of a submap that is due.

use super::Colorize;
use camera_alignment::{AlignmentExposure, Profile, profiles_by_camera};
use coloring::{
    CameraCubes, Candidates, ExposureWindow, HeldExposure, SpectraColumn, SubmapPoints, color_into, visibility_maps,
};
use geometry::{Pose, Stamp};
use materials::PointMaterials;
use messages::{
    CheckedSubmap, ColorTopic, MaterialTopic, Message, RegionHeader, RegionTopic, SpectraTopic, SubmapHeader,
    SubmapTopic,
};
use stage::{Outputs, Received, StepError};

/// Time before and after an exposure at which its pose is evaluated to see how a delay moves edges, ns. In this time the
/// vehicle moves much more than the noise of the pose, but does not turn.
const SHIFT_NANOS: i64 = 20_000_000;

impl Colorize {
    pub(super) fn publish_columns(
        &mut self,
        submap: &Received<SubmapTopic>,
        outputs: &mut Outputs,
    ) -> Result<(), StepError> {
        if let Some(remark) = self.remark {
            outputs.note(remark);
        }
        let header = submap.header();
        let CheckedSubmap { world_from_submap, sweeps, .. } = header.checked(submap.seq())?;
        let mut buffers = std::mem::take(&mut self.buffers);
        let points = SubmapPoints::new(submap.rows(), sweeps, header.stamp_begin, header.ring_counts(), &mut buffers);
        let profiles = self.publish_color(submap, &points, &world_from_submap, outputs)?;
        self.held.monitor.add(profiles);
        let mut materials = self.materials.take();
        self.publish_spectra(submap, &points, &world_from_submap, materials.as_mut(), outputs)?;
        self.materials = materials;
        self.buffers = buffers;
        Ok(())
    }

    /// Returns the brightness profiles at depth edges, too, with the index of their camera.
    fn publish_color(
        &self,
        submap: &Received<SubmapTopic>,
        points: &SubmapPoints<'_>,
        world_from_submap: &Pose,
        outputs: &mut Outputs,
    ) -> Result<Vec<(usize, Vec<Profile>)>, StepError> {
        let (mut exposures, mut images, mut shifted) = (Vec::new(), Vec::new(), Vec::new());
        for (image, world_from_body) in self.within_reach(&self.held.images, submap.header(), outputs) {
            let Some(pixels) = self.color_image(image) else { continue };
            let camera = &self.cameras[image.header().camera as usize];
            exposures.push(camera.exposure(image.stamp(), &world_from_body, world_from_submap));
            images.push(pixels);
            shifted.push([-SHIFT_NANOS, SHIFT_NANOS].map(|nanos| {
                let stamp = image.stamp().saturating_add(nanos);
                Some(camera.exposure(stamp, &self.held.trajectory.at(Stamp(stamp))?, world_from_submap))
            }));
        }
        let visibility = visibility_maps(points, &exposures);
        let candidates = Candidates { points, exposures: &exposures, visibility: &visibility, limits: self.limits };
        let n_points = points.rows.len();
        let mut loan = outputs.loan::<ColorTopic>(n_points)?;
        let rows = loan.grow_unset(n_points)?;
        let n_seen = color_into(&candidates, &images, self.level_exposures, rows);
        loan.header_mut().n_seen = n_seen;
        outputs.count("points", n_points as u64);
        outputs.count("points_with_color", n_seen);
        outputs.publish_column(loan, submap.stamp(), submap.seq())?;

        let header = submap.header();
        let needed = (0..exposures.len()).filter(|i| {
            let is_within = (header.stamp_begin..=header.stamp_end).contains(&exposures[*i].stamp);
            is_within && !self.held.monitor.is_complete(images[*i].camera())
        });
        let monitored = needed.filter_map(|i| {
            let [before, after] = shifted[i];
            let exposure = AlignmentExposure {
                exposure: exposures[i],
                shifted: [before?, after?],
                shift_s: 2e-9 * SHIFT_NANOS as f32,
                visibility: &visibility[i],
                image: images[i],
            };
            Some((images[i].camera(), exposure))
        });
        Ok(profiles_by_camera(points, &monitored.collect::<Vec<_>>()))
    }

    fn publish_spectra(
        &self,
        submap: &Received<SubmapTopic>,
        points: &SubmapPoints<'_>,
        world_from_submap: &Pose,
        materials: Option<&mut PointMaterials>,
        outputs: &mut Outputs,
    ) -> Result<(), StepError> {
        let mut cameras: Vec<CameraCubes<'_>> = self.mosaics.iter().map(|_| CameraCubes::default()).collect();
        for (cube, world_from_body) in self.within_reach(&self.held.cubes, submap.header(), outputs) {
            let Some(cells) = self.cube_image(cube) else { continue };
            let header = cube.header();
            let index = header.camera as usize;
            let area = [header.x0, header.y0, header.width * header.pattern, header.height * header.pattern];
            let exposure =
                self.mosaics[index].exposure_of_area(cube.stamp(), &world_from_body, world_from_submap, area);
            cameras[index].exposures.push(exposure);
            cameras[index].cubes.push(cells);
        }
        let column = SpectraColumn::new(points, self.bands.bands(), &cameras, self.limits);
        let mut loan = outputs.loan::<SpectraTopic>(column.n_rows())?;
        *loan.header_mut() = column.header();
        let rows = loan.grow_unset(column.n_rows())?;
        column.write_into(rows);
        let regions = self.has_regions.then(|| column.regions());
        let find =
            |materials: &mut PointMaterials| materials.column(points.rows, &column.header(), rows, regions.as_deref());
        let material = materials.map(find);
        outputs.count("points_with_spectrum", column.n_spectra() as u64);
        outputs.publish_column(loan, submap.stamp(), submap.seq())?;
        if let Some((header, rows)) = material {
            outputs.count("points_with_material", header.n_known);
            publish::<MaterialTopic>(submap, header, &rows, outputs)?;
        }
        if let Some(rows) = regions {
            let n_points = rows.iter().filter(|region| **region != 0).count() as u64;
            outputs.count("points_with_region", n_points);
            publish::<RegionTopic>(submap, RegionHeader { n_points }, &rows, outputs)?;
        }
        Ok(())
    }

    /// The exposures within `max_age_s` of the submap, with `world_from_body`. Exposures before the first or after the last
    /// known pose are skipped and counted, once per submap.
    fn within_reach<'a, T: Message>(
        &self,
        window: &'a ExposureWindow<Received<T>>,
        header: &SubmapHeader,
        outputs: &mut Outputs,
    ) -> Vec<(&'a Received<T>, Pose)> {
        let from = header.stamp_begin.saturating_sub(self.max_age_nanos);
        let until = header.stamp_end.saturating_add(self.max_age_nanos);
        let near = window.within(from..=until);
        let posed =
            |held: &'a HeldExposure<Received<T>>| Some((&held.data, self.held.trajectory.at(Stamp(held.stamp))?));
        let found: Vec<_> = near.iter().filter_map(posed).collect();
        outputs.count("exposures_without_pose", (near.len() - found.len()) as u64);
        found
    }
}

/// Publishes a column of the submap.
fn publish<T: Message>(
    submap: &Received<SubmapTopic>,
    header: T::Header,
    rows: &[T::Row],
    outputs: &mut Outputs,
) -> Result<(), StepError> {
    let mut loan = outputs.loan::<T>(rows.len())?;
    *loan.header_mut() = header;
    loan.extend_from_slice(rows)?;
    outputs.publish_column(loan, submap.stamp(), submap.seq())
}
