//! What goes out: the columns of a submap that is due.

use super::Colorize;
use crate::choose::Sources;
use crate::cloud::Cloud;
use crate::color::color_into;
use crate::occlusion::sights;
use crate::offset::{Look, Profile};
use crate::offset_watch::look;
use crate::spectra::{CameraCubes, Found};
use crate::window::{Exposure, Window};
use geometry::{Pose, Stamp};
use messages::{Color, Spectra, Submap, SubmapHeader};
use stage::{Outputs, Received, StepError};

/// Times beside an exposure between which its view is said to move, ns: far more than the pose's own noise, far less than a turn.
const BESIDE_NANOS: i64 = 20_000_000;

impl Colorize {
    pub(super) fn publish_columns(
        &mut self,
        submap: &Received<Submap>,
        outputs: &mut Outputs,
    ) -> Result<(), StepError> {
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
        let mut memory = std::mem::take(&mut self.memory);
        let cloud = Cloud::new(submap.rows(), sweeps, header.stamp_begin, header.n_rings, &mut memory);
        let profiles = self.publish_color(submap, &cloud, &world_from_submap, outputs)?;
        self.held.watch.keep(profiles);
        self.publish_spectra(submap, &cloud, &world_from_submap, outputs)?;
        self.memory = memory;
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
        let n_seen = color_into(&sources, &pictures, self.level_exposures, rows);
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
}

fn too_small(topic: &str, n_rows: usize) -> StepError {
    StepError::Contract(format!("{topic}: the loan does not hold the {n_rows} rows that were asked for"))
}
