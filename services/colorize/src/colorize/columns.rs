//! Output: the columns of a due submap.

use super::Colorize;
use camera_alignment::{AlignmentExposure, ExposureProfiles, profiles_of_exposures};
use coloring::{
    CameraCubes, Candidates, ColorSteps, ExposureWindow, HeldWithPose, SpectraColumn, SubmapPoints, color_into,
    visibility_maps,
};
use geometry::{Pose, Stamp};
use materials::PointMaterials;
use messages::{
    CheckedSubmap, ColorTopic, MaterialTopic, Message, RegionHeader, RegionTopic, SpectraTopic, SubmapHeader,
    SubmapTopic,
};
use stage::{Outputs, Received, StepError};

/// Time before and after an exposure at which its pose is evaluated to determine how a delay moves edges, ns. In this
/// time the vehicle moves much more than the noise of the pose, but does not turn.
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
        let CheckedSubmap { odom_from_submap, sweeps, .. } = header.checked(submap.seq())?;
        let mut buffers = std::mem::take(&mut self.buffers);
        let points = SubmapPoints::new(submap.rows(), sweeps, header.stamp_begin, header.ring_counts(), &mut buffers);
        let profiles = self.publish_color(submap, &points, &odom_from_submap, outputs)?;
        self.held.monitor.add(profiles);
        let mut materials = self.materials.take();
        self.publish_spectra(submap, &points, &odom_from_submap, materials.as_mut(), outputs)?;
        self.materials = materials;
        self.buffers = buffers;
        Ok(())
    }

    /// Publishes the colors of a submap. Also returns the brightness profiles at depth edges.
    fn publish_color(
        &self,
        submap: &Received<SubmapTopic>,
        points: &SubmapPoints<'_>,
        odom_from_submap: &Pose,
        outputs: &mut Outputs,
    ) -> Result<Vec<ExposureProfiles>, StepError> {
        let mut exposures = Vec::new();
        let mut images = Vec::new();
        let mut shifted = Vec::new();
        for HeldWithPose { data: image, odom_from_body } in
            self.within_reach(&self.held.images, submap.header(), outputs)
        {
            let Some(pixels) = self.color_image(image) else { continue };
            let camera = &self.cameras[image.header().camera as usize];
            exposures.push(camera.exposure(image.stamp(), &odom_from_body, odom_from_submap));
            images.push(pixels);
            shifted.push([-SHIFT_NANOS, SHIFT_NANOS].map(|nanos| {
                let stamp = image.stamp().saturating_add(nanos);
                Some(camera.exposure(stamp, &self.held.trajectory.at(Stamp(stamp))?, odom_from_submap))
            }));
        }
        let visibility = visibility_maps(points, &exposures);
        let candidates = Candidates { points, exposures: &exposures, visibility: &visibility, limits: self.limits };
        let n_points = points.rows.len();
        let mut loan = outputs.loan::<ColorTopic>(n_points)?;
        let rows = loan.grow_unset(n_points)?;
        let settings = &self.settings;
        let steps = ColorSteps { level_exposures: settings.level_exposures, reject_sky: settings.reject_sky };
        let n_seen = color_into(&candidates, &images, steps, rows);
        loan.header_mut().n_seen = n_seen;
        outputs.count("points", n_points as u64);
        outputs.count("points_with_color", n_seen);
        outputs.publish_column(loan, submap.stamp(), submap.seq())?;

        let span = submap.header().stamp_begin..=submap.header().stamp_end;
        let seen = exposures.iter().zip(&images).zip(&visibility).zip(&shifted);
        let seen = seen.filter(|(((exposure, _), _), _)| span.contains(&exposure.stamp));
        let shift_s = 2e-9 * SHIFT_NANOS as f32;
        let posed = seen.filter_map(|(((exposure, image), visibility), [before, after])| {
            let shifted = [(*before)?, (*after)?];
            Some(AlignmentExposure { exposure: *exposure, shifted, shift_s, visibility, image: *image })
        });
        Ok(profiles_of_exposures(points, &self.held.monitor.needed(posed)))
    }

    fn publish_spectra(
        &self,
        submap: &Received<SubmapTopic>,
        points: &SubmapPoints<'_>,
        odom_from_submap: &Pose,
        materials: Option<&mut PointMaterials>,
        outputs: &mut Outputs,
    ) -> Result<(), StepError> {
        let mut cameras: Vec<CameraCubes<'_>> = self.mosaics.iter().map(|_| CameraCubes::default()).collect();
        for HeldWithPose { data: cube, odom_from_body } in self.within_reach(&self.held.cubes, submap.header(), outputs)
        {
            let Some(cells) = self.cube_image(cube) else { continue };
            let index = cube.header().camera as usize;
            cameras[index].add(&self.mosaics[index], cells, [&odom_from_body, odom_from_submap], cube.stamp());
        }
        let column = SpectraColumn::new(points, self.bands.bands(), &cameras, self.limits);
        let mut loan = outputs.loan::<SpectraTopic>(column.n_rows())?;
        *loan.header_mut() = column.header();
        let rows = loan.grow_unset(column.n_rows())?;
        column.write_into(rows);
        let regions = self.settings.regions.then(|| column.regions());
        let material = materials.map(|found| found.column(points.rows, &column.header(), rows, regions.as_deref()));
        outputs.count("points_with_spectrum", column.n_spectra() as u64);
        outputs.publish_column(loan, submap.stamp(), submap.seq())?;
        if let Some((header, rows)) = material {
            outputs.count("points_with_material", header.n_known);
            outputs.publish_column_rows::<MaterialTopic>(header, &rows, submap.stamp(), submap.seq())?;
        }
        if let Some(rows) = regions {
            let n_points = rows.iter().filter(|region| **region != 0).count() as u64;
            outputs.count("points_with_region", n_points);
            let header = RegionHeader { n_points };
            outputs.publish_column_rows::<RegionTopic>(header, &rows, submap.stamp(), submap.seq())?;
        }
        Ok(())
    }

    /// The exposures within `max_age_s` of the submap. Exposures before the first or after the last
    /// known pose are skipped and counted, once per submap.
    fn within_reach<'a, T: Message>(
        &self,
        window: &'a ExposureWindow<Received<T>>,
        header: &SubmapHeader,
        outputs: &mut Outputs,
    ) -> Vec<HeldWithPose<'a, Received<T>>> {
        let from = header.stamp_begin.saturating_sub(self.max_age_nanos);
        let until = header.stamp_end.saturating_add(self.max_age_nanos);
        let found = window.posed_within(from..=until, &self.held.trajectory);
        outputs.count("exposures_without_pose", found.n_without_pose);
        found.exposures
    }
}
