//! The stage on a painted street whose every color is known.

mod common;

use colorize::{Colorize, Settings};
use common::scene::{self, EXPOSURES, Painted, SECOND, START};
use common::{bare_manifest, drive, submap};
use geometry::{Point3, Pose};
use messages::{
    Color, ColorRow, Cube, Image, Message, NO_SPECTRUM, NoHeader, Spectra, SpectraHeader, SpectraView, Submap,
    Trajectory, UNSEEN,
};
use stage::testing::{Bench, context};
use std::path::Path;

/// The submap lasts a second; every exposure that may matter to it is within two before and after.
const DURATION_NANOS: u32 = 1_000_000_000;
const N_TICKS: i64 = 30;

/// What a run publishes, and when.
#[derive(PartialEq, Debug)]
struct Published {
    colors: Vec<ColorRow>,
    spectra: (SpectraHeader, Vec<u32>),
    tick: Option<i64>,
}

struct Run<'a> {
    folder: &'a Path,
    /// Added to the stamps of images.
    delay_nanos: i64,
    /// A save, a crash and a load after every tick.
    is_restarted: bool,
    n_ticks: i64,
}

impl Run<'_> {
    /// Ticks of 0.1 s from 1.5 s before the submap; its message comes with the tick of its last shot.
    fn publish(&self) -> Published {
        let (settings, context) = (Settings::default(), context(self.folder));
        let mut bench = Bench::<Colorize>::new(&settings, &context).expect("starts");
        let painted = scene::points(DURATION_NANOS);
        let points: Vec<_> = painted.iter().map(|painted| painted.point).collect();
        let (mut found, mut found_at) = (Vec::new(), None);
        for tick in 0..self.n_ticks {
            let from = START - 3 * SECOND / 2 + tick * SECOND / 10;
            let until = from + SECOND / 10;
            bench.send::<Trajectory>(from, NoHeader::default(), scene::trajectory(from, until));
            for burst in scene::bursts().iter().filter(|burst| (from..until).contains(&burst.stamp)) {
                for (header, rows) in &burst.images {
                    bench.send::<Image>(burst.stamp + self.delay_nanos, *header, rows.clone());
                }
                for (header, rows) in &burst.cubes {
                    bench.send::<Cube>(burst.stamp, *header, rows.clone());
                }
            }
            if until == START + i64::from(DURATION_NANOS) {
                bench.send::<Submap>(START, submap(scene::world_from_submap(), START, &points), points.clone());
            }
            bench.tick().expect("a tick");
            found.extend(bench.take::<Color>());
            found_at = found_at.or((!found.is_empty()).then_some(tick));
            if self.is_restarted {
                bench = bench.restarted(&settings, &context).expect("takes its state up");
            }
        }
        bench.finish().expect("an end");
        found.extend(bench.take::<Color>());
        let spectra = bench.take::<Spectra>();
        assert_eq!((found.len(), spectra.len()), (1, 1));
        let color = &found[0];
        assert_eq!((color.seq(), color.stamp(), spectra[0].seq()), (0, START, 0));
        let n_seen = color.rows().iter().filter(|row| row.camera != UNSEEN).count() as u64;
        assert_eq!(color.header().n_seen, n_seen);
        Published {
            colors: color.rows().to_vec(),
            spectra: (*spectra[0].header(), spectra[0].rows().to_vec()),
            tick: found_at,
        }
    }
}

fn run(folder: &Path) -> Run<'_> {
    Run { folder, delay_nanos: 0, is_restarted: false, n_ticks: N_TICKS + 10 }
}

/// The camera that should color the point, by the exact models, one exposure after the other.
fn expected_camera(painted: &Painted, n_rig: usize, body_from_camera: &[Pose]) -> Option<usize> {
    let manifest = scene::manifest();
    let stamp = START + i64::from(painted.point.offset_nanos);
    let p = Point3::new(painted.point.x, painted.point.y, painted.point.z).cast::<f64>();
    let mut candidates: Vec<(i64, usize)> = EXPOSURES
        .iter()
        .map(|offset| (START + offset - stamp).abs())
        .zip(EXPOSURES)
        .filter(|(gap, _)| *gap <= SECOND)
        .flat_map(|(gap, offset)| (0..n_rig).map(move |camera| (gap, offset, camera)))
        .filter(|(_, offset, camera)| {
            let world_from_camera = scene::world_from_body(START + offset) * body_from_camera[*camera];
            let p_in_camera = world_from_camera.inverse() * scene::world_from_submap() * p;
            manifest.cameras[*camera].model.pixel_from_camera(&p_in_camera).is_some()
        })
        .map(|(gap, _, camera)| (gap, camera))
        .collect();
    candidates.sort_unstable();
    candidates.first().map(|(_, camera)| *camera)
}

fn share_of_right_colors(colors: &[ColorRow]) -> f64 {
    let seen = || scene::points(DURATION_NANOS).into_iter().zip(colors).filter(|(_, row)| row.camera != UNSEEN);
    let is_right = |(painted, row): &(Painted, &ColorRow)| painted.color == [row.r, row.g, row.b];
    seen().filter(is_right).count() as f64 / seen().count() as f64
}

#[test]
fn every_point_has_the_color_of_its_place_and_the_camera_that_saw_it() {
    let folder = drive(&scene::manifest());
    let published = run(folder.path()).publish();
    let rig = scene::manifest().rig().expect("sound");
    let body_from_camera: Vec<Pose> = rig.cameras.iter().map(|camera| camera.body_from_camera).collect();
    let mut n_seen = [0; 2];
    let mut n_doubtful = 0;
    for (painted, row) in scene::points(DURATION_NANOS).iter().zip(&published.colors) {
        let expected = expected_camera(painted, 2, &body_from_camera).map_or(UNSEEN, |camera| camera as u8);
        // A square at the very rim of an image or of the lens may fall to either side.
        n_doubtful += usize::from(row.camera != expected);
        match row.camera {
            UNSEEN => assert_eq!([row.r, row.g, row.b], [0, 0, 0]),
            camera => n_seen[usize::from(camera)] += 1,
        }
    }
    let n_points = published.colors.len();
    assert!(n_doubtful * 200 < n_points, "{n_doubtful} of {n_points} points have another camera than expected");
    assert!(n_seen.iter().all(|n| *n > 100), "{n_seen:?}");
    assert!(n_seen.iter().sum::<usize>() < n_points, "some points are meant to be unseen");
    // Squares at the rims of the image are a few pixels wide and mix with their neighbors.
    let share = share_of_right_colors(&published.colors);
    assert!(share > 0.98, "{share} of the colors are right");
}

#[test]
fn an_exposure_stamped_50_ms_late_colors_the_wrong_places() {
    let folder = drive(&scene::manifest());
    let late = Run { delay_nanos: 50_000_000, ..run(folder.path()) }.publish();
    let share = share_of_right_colors(&late.colors);
    assert!(share < 0.3, "{share} of the colors are right");
}

#[test]
fn a_submap_waits_for_the_exposures_after_its_end_and_no_longer() {
    let folder = drive(&scene::manifest());
    // It ends with tick 24; the trajectory is a second further with tick 34.
    assert_eq!(run(folder.path()).publish().tick, Some(34));
    // The stream ends first: it is colored with what there is.
    let cut = Run { n_ticks: 27, ..run(folder.path()) }.publish();
    assert_eq!(cut.tick, None);
    assert!(share_of_right_colors(&cut.colors) > 0.98);
}

#[test]
fn the_next_submap_or_a_blind_rig_ends_the_wait() {
    let painted = scene::points(DURATION_NANOS);
    let points: Vec<_> = painted.iter().map(|painted| painted.point).collect();
    let send = |bench: &mut Bench<Colorize>, stamp| {
        let header = submap(scene::world_from_submap(), stamp, &points);
        bench.send::<Trajectory>(stamp, NoHeader::default(), scene::trajectory(stamp, header.stamp_end - SECOND / 10));
        bench.send::<Submap>(stamp, header, points.clone());
        bench.tick().expect("a tick");
        bench.take::<Color>().iter().map(stage::Received::seq).collect::<Vec<_>>()
    };
    let sighted = drive(&scene::manifest());
    let mut bench = Bench::<Colorize>::new(&Settings::default(), &context(sighted.path())).expect("starts");
    assert_eq!(send(&mut bench, START), Vec::<u64>::new());
    assert_eq!(send(&mut bench, START + SECOND), [0]);
    assert_eq!(bench.counter("submaps_colored_early"), 1);
    bench.finish().expect("an end");
    assert_eq!(bench.take::<Color>().len(), 1);

    let blind = drive(&bare_manifest());
    let mut bench = Bench::<Colorize>::new(&Settings::default(), &context(blind.path())).expect("starts");
    assert_eq!(send(&mut bench, START), [0]);
    assert_eq!(bench.counter("submaps_colored_early"), 0);
    assert_eq!(bench.notes(), ["no cameras in this drive: points stay without color"]);
    let spectra = bench.take::<Spectra>();
    let (header, rows) = (spectra[0].header(), spectra[0].rows());
    assert_eq!((header.n_points as usize, header.n_spectra, header.n_bands), (points.len(), 0, 0));
    assert_eq!(rows, vec![NO_SPECTRUM; points.len()]);
}

#[test]
fn the_last_tick_may_bring_as_many_columns_as_can_be_due() {
    let folder = drive(&scene::manifest());
    let mut bench = Bench::<Colorize>::new(&Settings::default(), &context(folder.path())).expect("starts");
    for (n_submaps, n_columns) in [(1, 0), (Submap::QUEUE, Submap::QUEUE)] {
        for _ in 0..n_submaps {
            bench.send::<Submap>(START, submap(scene::world_from_submap(), START, &[]), Vec::new());
        }
        bench.tick().expect("a tick");
        assert_eq!(bench.take::<Spectra>().len(), n_columns, "one is held");
    }
    bench.finish().expect("an end");
    // Two in the last step and one at its end make three in one tick; an empty submap has empty columns.
    let columns = bench.take::<Color>();
    assert_eq!(columns.len(), Color::QUEUE);
    assert!(columns.iter().all(|column| column.rows().is_empty()));
}

#[test]
fn a_restart_after_every_tick_changes_nothing() {
    let folder = drive(&scene::manifest());
    let undisturbed = run(folder.path()).publish();
    let restarted = Run { is_restarted: true, ..run(folder.path()) }.publish();
    assert!(undisturbed == restarted);
    // Nor does the number of threads.
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    assert!(undisturbed == one_thread.install(|| run(folder.path()).publish()));
}

#[test]
fn the_spectra_of_two_materials_come_back_and_what_was_not_measured_does_not() {
    let folder = drive(&scene::manifest());
    let (header, rows) = run(folder.path()).publish().spectra;
    let painted = scene::points(DURATION_NANOS);
    assert_eq!((header.n_points as usize, header.n_bands), (painted.len(), 41));
    assert_eq!(
        (header.wavelengths_nm[24], header.wavelengths_nm[25], header.cameras[24..26].to_vec()),
        (740.0, 500.0, vec![0, 1])
    );
    let view = SpectraView::new(&header, &rows).expect("fits");
    let (mut n_spectra, mut n_full, mut n_per_material) = (0, 0, [0; 2]);
    for (point_idx, painted) in painted.iter().enumerate() {
        let Some((valid, reflectances)) = view.spectrum(point_idx) else { continue };
        n_spectra += 1;
        assert!(valid != 0 && painted.is_left, "the mosaic cameras look to the left");
        assert_eq!(valid >> 28 & 1, 0, "band 3 of camera 1 is dead");
        assert!(valid >> 41 == 0);
        n_full += usize::from(valid == ((1_u64 << 41) - 1) & !(1 << 28));
        let is_near_border = (painted.along_m - scene::BORDER_M).abs() < 0.5;
        for (band, reflectance) in reflectances.iter().enumerate() {
            let (index, k) = if band < 25 { (0, band) } else { (1, band - 25) };
            if valid >> band & 1 == 0 {
                assert_eq!(*reflectance, 0.0);
            } else if !is_near_border {
                assert_eq!(*reflectance, scene::reflectance(index, k, painted.along_m), "at {} m", painted.along_m);
            }
        }
        n_per_material[usize::from(painted.along_m > scene::BORDER_M)] += 1;
    }
    assert_eq!(n_spectra, header.n_spectra);
    assert!(n_per_material.iter().all(|n| *n > 50), "{n_per_material:?}");
    assert!(n_full > 20, "both cameras see part of the wall");
    assert!(n_full < n_spectra as usize, "camera 0 saturates in its upper half");
}

#[test]
fn exposures_that_do_not_fit_the_rig_are_counted_and_not_used() {
    let folder = drive(&scene::manifest());
    let mut bench = Bench::<Colorize>::new(&Settings::default(), &context(folder.path())).expect("starts");
    let (header, rows) = scene::expose(0, START);
    bench.send::<Image>(START, messages::ImageHeader { camera: 2, ..header }, rows.clone());
    bench.send::<Image>(START, messages::ImageHeader { width: 300, height: 400, ..header }, rows.clone());
    bench.send::<Image>(START, header, rows[3..].to_vec());
    let (header, rows) = scene::expose_cube(1, START);
    bench.send::<Cube>(START, messages::CubeHeader { camera: 0, ..header }, rows.clone());
    bench.send::<Cube>(START, messages::CubeHeader { x0: 4, ..header }, rows.clone());
    bench.send::<Cube>(START, messages::CubeHeader { x0: u32::MAX, ..header }, rows);
    bench.tick().expect("a tick");
    assert_eq!((bench.counter("images_unusable"), bench.counter("cubes_unusable")), (3, 3));
}

#[test]
fn a_hundred_exposures_and_no_submap_do_not_pile_up() {
    let folder = drive(&scene::manifest());
    let mut bench = Bench::<Colorize>::new(&Settings::default(), &context(folder.path())).expect("starts");
    let (header, rows) = scene::expose(0, START);
    for i in 0..100 {
        bench.send::<Image>(START + i, header, rows.clone());
    }
    bench.tick().expect("a tick");
    assert_eq!(bench.counter("exposures_released_early"), 4);
}

#[test]
fn a_trajectory_that_is_none_stops_the_stage() {
    let folder = drive(&scene::manifest());
    let mut bench = Bench::<Colorize>::new(&Settings::default(), &context(folder.path())).expect("starts");
    let mut rows = scene::trajectory(START, START + SECOND);
    rows[3].world_from_body.rotation = [0.0; 4];
    bench.send::<Trajectory>(START, NoHeader::default(), rows);
    let error = bench.tick().expect_err("no pose").to_string();
    assert!(error.contains("is no pose"), "{error}");
}
