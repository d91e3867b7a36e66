//! The stage on a painted street where every color is known.

use crate::support::painted_street::{self as street, EXPOSURES, Painted, SECOND, START};
use crate::support::{bare_manifest, drive, submap};
use colorize::{Colorize, Settings};
use geometry::{Point3, Pose};
use messages::{
    ColorRow, ColorTopic, CubeTopic, ImageTopic, MaterialTopic, Message, NO_SPECTRUM, NoHeader, RegionTopic,
    SpectraHeader, SpectraTopic, SpectraView, SubmapTopic, TrajectoryTopic, UNSEEN,
};
use stage::Stage;
use stage::testing::{Bench, context};
use std::path::Path;

/// Duration of the submap. All exposures that may color it are within two seconds before and after.
const DURATION_NANOS: u32 = 1_000_000_000;
const N_TICKS: i64 = 30;

/// The output of a run, and the tick of its publication.
#[derive(PartialEq, Debug)]
struct Published {
    colors: Vec<ColorRow>,
    spectra: (SpectraHeader, Vec<u32>),
    tick: Option<i64>,
}

struct Run<'a> {
    folder: &'a Path,
    /// Delay added to the stamps of images.
    delay_nanos: i64,
    /// Whether the stage saves, restarts and loads after every tick.
    is_restarted: bool,
    n_ticks: i64,
}

impl Run<'_> {
    /// Runs ticks of 0.1 s from 1.5 s before the submap. The submap arrives in the tick of its last shot.
    fn publish(&self) -> Published {
        let settings = Settings::default();
        let context = context(self.folder);
        let mut bench = Bench::<Colorize>::new(&settings, &context).expect("starts");
        let painted = street::points(DURATION_NANOS);
        let points: Vec<_> = painted.iter().map(|painted| painted.point).collect();
        let mut found = Vec::new();
        let mut found_at = None;
        for tick in 0..self.n_ticks {
            let from = START - 3 * SECOND / 2 + tick * SECOND / 10;
            let until = from + SECOND / 10;
            bench.send::<TrajectoryTopic>(from, NoHeader::default(), street::trajectory(from, until));
            for burst in street::bursts().iter().filter(|burst| (from..until).contains(&burst.stamp)) {
                for (header, rows) in &burst.images {
                    bench.send::<ImageTopic>(burst.stamp + self.delay_nanos, *header, rows.clone());
                }
                for (header, rows) in &burst.cubes {
                    bench.send::<CubeTopic>(burst.stamp, *header, rows.clone());
                }
            }
            if until == START + i64::from(DURATION_NANOS) {
                bench.send::<SubmapTopic>(START, submap(street::odom_from_submap(), START, &points), points.clone());
            }
            bench.tick().expect("a tick");
            found.extend(bench.take::<ColorTopic>());
            found_at = found_at.or((!found.is_empty()).then_some(tick));
            if self.is_restarted {
                bench = bench.restarted(&settings, &context).expect("loads its state");
            }
        }
        bench.finish().expect("an end");
        found.extend(bench.take::<ColorTopic>());
        let spectra = bench.take::<SpectraTopic>();
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

/// The camera that should color the point, by the exact camera models.
fn expected_camera(painted: &Painted, n_rig: usize, body_from_camera: &[Pose]) -> Option<usize> {
    let manifest = street::manifest();
    let stamp = START + i64::from(painted.point.offset_nanos);
    let p = Point3::new(painted.point.x, painted.point.y, painted.point.z).cast::<f64>();
    let mut candidates: Vec<(i64, usize)> = EXPOSURES
        .iter()
        .map(|offset| (START + offset - stamp).abs())
        .zip(EXPOSURES)
        .filter(|(gap, _)| *gap <= SECOND)
        .flat_map(|(gap, offset)| (0..n_rig).map(move |camera| (gap, offset, camera)))
        .filter(|(_, offset, camera)| {
            let odom_from_camera = street::odom_from_body(START + offset) * body_from_camera[*camera];
            let p_in_camera = odom_from_camera.inverse() * street::odom_from_submap() * p;
            manifest.cameras[*camera].model.pixel_from_camera(&p_in_camera).is_some()
        })
        .map(|(gap, _, camera)| (gap, camera))
        .collect();
    candidates.sort_unstable();
    candidates.first().map(|(_, camera)| *camera)
}

fn share_of_right_colors(colors: &[ColorRow]) -> f64 {
    let seen = || street::points(DURATION_NANOS).into_iter().zip(colors).filter(|(_, row)| row.camera != UNSEEN);
    let is_right = |(painted, row): &(Painted, &ColorRow)| painted.color == [row.r, row.g, row.b];
    seen().filter(is_right).count() as f64 / seen().count() as f64
}

#[test]
fn points_get_true_color_and_expected_camera() {
    let folder = drive(&street::manifest());
    let published = run(folder.path()).publish();
    let rig = street::manifest().rig().expect("sound");
    let body_from_camera: Vec<Pose> = rig.cameras.iter().map(|camera| camera.body_from_camera).collect();
    let mut n_seen = [0; 2];
    let mut n_doubtful = 0;
    for (painted, row) in street::points(DURATION_NANOS).iter().zip(&published.colors) {
        let expected = expected_camera(painted, 2, &body_from_camera).map_or(UNSEEN, |camera| camera as u8);
        // A square at the border of an image or of the lens may be inside or outside.
        n_doubtful += usize::from(row.camera != expected);
        match row.camera {
            UNSEEN => assert_eq!([row.r, row.g, row.b], [0, 0, 0]),
            camera => n_seen[usize::from(camera)] += 1,
        }
    }
    let n_points = published.colors.len();
    assert!(n_doubtful * 200 < n_points, "{n_doubtful} of {n_points} points have another camera than expected");
    assert!(n_seen.iter().all(|n| *n > 100), "{n_seen:?}");
    assert!(n_seen.iter().sum::<usize>() < n_points, "some points must be unseen");
    // Squares at the image border are a few pixels wide and mix with their neighbors.
    let share = share_of_right_colors(&published.colors);
    assert!(share > 0.98, "{share} of the colors are right");
}

#[test]
fn exposure_stamped_50_ms_late_gives_wrong_colors() {
    let folder = drive(&street::manifest());
    let late = Run { delay_nanos: 50_000_000, ..run(folder.path()) }.publish();
    let share = share_of_right_colors(&late.colors);
    assert!(share < 0.3, "{share} of the colors are right");
}

#[test]
fn submap_waits_for_exposures_after_its_end() {
    let folder = drive(&street::manifest());
    // The submap ends in tick 24. The trajectory is one second further in tick 34.
    assert_eq!(run(folder.path()).publish().tick, Some(34));
    // The stream ends first: the submap is colored with the exposures so far.
    let cut = Run { n_ticks: 27, ..run(folder.path()) }.publish();
    assert_eq!(cut.tick, None);
    assert!(share_of_right_colors(&cut.colors) > 0.98);
}

#[test]
fn submap_wait_ends_with_next_submap_or_without_cameras() {
    let painted = street::points(DURATION_NANOS);
    let points: Vec<_> = painted.iter().map(|painted| painted.point).collect();
    let send = |bench: &mut Bench<Colorize>, stamp| {
        let header = submap(street::odom_from_submap(), stamp, &points);
        bench.send::<TrajectoryTopic>(
            stamp,
            NoHeader::default(),
            street::trajectory(stamp, header.stamp_end - SECOND / 10),
        );
        bench.send::<SubmapTopic>(stamp, header, points.clone());
        bench.tick().expect("a tick");
        bench.take::<ColorTopic>().iter().map(stage::Received::seq).collect::<Vec<_>>()
    };
    let with_cameras = drive(&street::manifest());
    let mut bench = Bench::<Colorize>::new(&Settings::default(), &context(with_cameras.path())).expect("starts");
    assert_eq!(send(&mut bench, START), Vec::<u64>::new());
    assert_eq!(send(&mut bench, START + SECOND), [0]);
    assert_eq!(bench.counter("submaps_colored_early"), 1);
    bench.finish().expect("an end");
    assert_eq!(bench.take::<ColorTopic>().len(), 1);

    let without_cameras = drive(&bare_manifest());
    let mut bench = Bench::<Colorize>::new(&Settings::default(), &context(without_cameras.path())).expect("starts");
    assert_eq!(send(&mut bench, START), [0]);
    assert_eq!(bench.counter("submaps_colored_early"), 0);
    assert_eq!(bench.notes(), ["no cameras in this drive: points stay without color"]);
    let spectra = bench.take::<SpectraTopic>();
    let header = spectra[0].header();
    let rows = spectra[0].rows();
    assert_eq!((header.n_points as usize, header.n_spectra, header.n_bands), (points.len(), 0, 0));
    assert_eq!(rows, vec![NO_SPECTRUM; points.len()]);
}

#[test]
fn materials_are_published_for_points_with_a_spectrum_if_they_are_on() {
    let folder = drive(&street::manifest());
    let outputs = |settings: &Settings| {
        let ports = Colorize::outputs_with(settings, folder.path()).expect("ports");
        ports.iter().map(stage::Port::topic).collect::<Vec<_>>()
    };
    let on = Settings { materials: true, ..Settings::default() };
    assert_eq!(outputs(&Settings::default()), ["color", "spectra"]);
    assert_eq!(outputs(&on), ["color", "spectra", "material"]);
    let mut bench = Bench::<Colorize>::new(&on, &context(folder.path())).expect("starts");
    let from = START - 2 * SECOND;
    let until = START + 2 * SECOND;
    bench.send::<TrajectoryTopic>(from, NoHeader::default(), street::trajectory(from, until));
    for burst in street::bursts() {
        for (header, rows) in &burst.cubes {
            bench.send::<CubeTopic>(burst.stamp, *header, rows.clone());
        }
    }
    let points: Vec<_> = street::points(DURATION_NANOS).iter().map(|painted| painted.point).collect();
    bench.send::<SubmapTopic>(START, submap(street::odom_from_submap(), START, &points), points.clone());
    bench.tick().expect("a tick");
    bench.finish().expect("an end");
    let spectra = bench.take::<SpectraTopic>();
    let materials = bench.take::<MaterialTopic>();
    assert_eq!((materials.len(), materials[0].seq(), materials[0].rows().len()), (1, 0, points.len()));
    let view = SpectraView::new(spectra[0].header(), spectra[0].rows()).expect("fits");
    let has_spectrum = (0..points.len()).filter(|i| view.spectrum(*i).is_some()).count();
    let scored = materials[0].rows().iter().enumerate().filter(|(_, row)| row.score > 0);
    assert!(scored.clone().all(|(i, _)| view.spectrum(i).is_some()));
    assert!(scored.count() * 2 > has_spectrum, "most of {has_spectrum} points have a material");
    let n_known = materials[0].rows().iter().filter(|row| row.material_id != 0).count() as u64;
    assert_eq!((materials[0].header().n_known, bench.counter("points_with_material")), (n_known, n_known));
}

#[test]
fn regions_of_cells_are_published_for_their_points_if_they_are_on() {
    let folder = drive(&street::manifest());
    let on = Settings { regions: true, ..Settings::default() };
    let ports = Colorize::outputs_with(&on, folder.path()).expect("ports");
    assert_eq!(ports.iter().map(stage::Port::topic).collect::<Vec<_>>(), ["color", "spectra", "region"]);
    let mut bench = Bench::<Colorize>::new(&on, &context(folder.path())).expect("starts");
    let from = START - 2 * SECOND;
    let until = START + 2 * SECOND;
    bench.send::<TrajectoryTopic>(from, NoHeader::default(), street::trajectory(from, until));
    for burst in street::bursts() {
        for (header, rows) in &burst.cubes {
            // Camera 1 has a region in every other cell, camera 0 another one in all.
            let cells = 0..header.width * header.height;
            let mut rows = rows.clone();
            rows.extend(cells.map(|cell| if header.camera == 0 { 7 } else { 8 * (cell % 2) }));
            bench.send::<CubeTopic>(burst.stamp, *header, rows);
        }
    }
    let points: Vec<_> = street::points(DURATION_NANOS).iter().map(|painted| painted.point).collect();
    bench.send::<SubmapTopic>(START, submap(street::odom_from_submap(), START, &points), points.clone());
    bench.tick().expect("a tick");
    bench.finish().expect("an end");
    let spectra = bench.take::<SpectraTopic>();
    let regions = bench.take::<RegionTopic>();
    assert_eq!((regions.len(), regions[0].seq(), regions[0].rows().len()), (1, 0, points.len()));
    let view = SpectraView::new(spectra[0].header(), spectra[0].rows()).expect("fits");
    let mut counts = [0; 3];
    for (i, region) in regions[0].rows().iter().enumerate() {
        // Bits of the bands of camera 0, then of camera 1.
        let seen = view.spectrum(i).map_or(0, |(valid, _)| valid);
        let possible: &[u32] = match (seen & 0x1ff_ffff != 0, seen >> 25 != 0) {
            (true, _) => &[7],
            (false, true) => &[0, 8],
            (false, false) => &[0],
        };
        assert!(possible.contains(region), "point {i} of bands {seen:b} has region {region}");
        counts[[0, 7, 8].iter().position(|known| known == region).expect("known")] += 1;
    }
    assert!(counts.iter().all(|n| *n > 20), "{counts:?}");
    assert_eq!(regions[0].header().n_points, bench.counter("points_with_region"));
}

#[test]
fn last_tick_publishes_at_most_queue_columns() {
    let folder = drive(&street::manifest());
    let mut bench = Bench::<Colorize>::new(&Settings::default(), &context(folder.path())).expect("starts");
    for (n_submaps, n_columns) in [(1, 0), (SubmapTopic::QUEUE, SubmapTopic::QUEUE)] {
        for _ in 0..n_submaps {
            bench.send::<SubmapTopic>(START, submap(street::odom_from_submap(), START, &[]), Vec::new());
        }
        bench.tick().expect("a tick");
        assert_eq!(bench.take::<SpectraTopic>().len(), n_columns, "one is held");
    }
    bench.finish().expect("an end");
    // Two in the last step and one in `finish` make three in one tick. An empty submap has empty columns.
    let columns = bench.take::<ColorTopic>();
    assert_eq!(columns.len(), ColorTopic::QUEUE);
    assert!(columns.iter().all(|column| column.rows().is_empty()));
}

#[test]
fn restart_after_every_tick_gives_same_output() {
    let folder = drive(&street::manifest());
    let undisturbed = run(folder.path()).publish();
    let restarted = Run { is_restarted: true, ..run(folder.path()) }.publish();
    assert!(undisturbed == restarted);
    // One thread gives the same output.
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    assert!(undisturbed == one_thread.install(|| run(folder.path()).publish()));
}

#[test]
fn spectra_of_two_materials_are_exact_and_unmeasured_bands_invalid() {
    let folder = drive(&street::manifest());
    let (header, rows) = run(folder.path()).publish().spectra;
    let painted = street::points(DURATION_NANOS);
    assert_eq!((header.n_points as usize, header.n_bands), (painted.len(), 41));
    assert_eq!(
        (header.wavelengths_nm[24], header.wavelengths_nm[25], header.cameras[24..26].to_vec()),
        (740.0, 500.0, vec![0, 1])
    );
    let view = SpectraView::new(&header, &rows).expect("fits");
    let mut n_spectra = 0;
    let mut n_full = 0;
    let mut n_per_material = [0; 2];
    for (point_idx, painted) in painted.iter().enumerate() {
        let Some((valid, reflectances)) = view.spectrum(point_idx) else { continue };
        n_spectra += 1;
        assert!(valid != 0 && painted.is_left, "the mosaic cameras look to the left");
        assert_eq!(valid >> 28 & 1, 0, "band 3 of camera 1 is dead");
        assert!(valid >> 41 == 0);
        n_full += usize::from(valid == ((1_u64 << 41) - 1) & !(1 << 28));
        let is_near_border = (painted.along_m - street::BORDER_M).abs() < 0.5;
        for (band, reflectance) in reflectances.iter().enumerate() {
            let (index, k) = if band < 25 { (0, band) } else { (1, band - 25) };
            if valid >> band & 1 == 0 {
                assert_eq!(*reflectance, 0.0);
            } else if !is_near_border {
                assert_eq!(*reflectance, street::reflectance(index, k, painted.along_m), "at {} m", painted.along_m);
            }
        }
        n_per_material[usize::from(painted.along_m > street::BORDER_M)] += 1;
    }
    assert_eq!(n_spectra, header.n_spectra);
    assert!(n_per_material.iter().all(|n| *n > 50), "{n_per_material:?}");
    assert!(n_full > 20, "both cameras see part of the wall");
    assert!(n_full < n_spectra as usize, "camera 0 saturates in its upper half");
}

#[test]
fn exposures_not_matching_rig_are_counted_and_ignored() {
    let folder = drive(&street::manifest());
    let mut bench = Bench::<Colorize>::new(&Settings::default(), &context(folder.path())).expect("starts");
    let (header, rows) = street::expose(0, START);
    bench.send::<ImageTopic>(START, messages::ImageHeader { camera: 2, ..header }, rows.clone());
    bench.send::<ImageTopic>(START, messages::ImageHeader { width: 300, height: 400, ..header }, rows.clone());
    bench.send::<ImageTopic>(START, header, rows[3..].to_vec());
    let (header, rows) = street::expose_cube(1, START);
    bench.send::<CubeTopic>(START, messages::CubeHeader { camera: 0, ..header }, rows.clone());
    bench.send::<CubeTopic>(START, messages::CubeHeader { x0: 4, ..header }, rows.clone());
    bench.send::<CubeTopic>(START, messages::CubeHeader { x0: u32::MAX, ..header }, rows);
    bench.tick().expect("a tick");
    assert_eq!((bench.counter("images_unusable"), bench.counter("cubes_unusable")), (3, 3));
}

/// 33 bands fit no list of wavelengths: the message must not be read past its end.
#[test]
fn cube_of_more_bands_than_the_message_holds_is_counted_and_ignored() {
    let folder = drive(&street::manifest());
    let mut bench = Bench::<Colorize>::new(&Settings::default(), &context(folder.path())).expect("starts");
    let (header, rows) = street::expose_cube(0, START);
    let n_cells = rows.len() / (header.n_bands as usize + 1);
    for n_bands in [messages::MAX_CUBE_BANDS + 1, messages::MAX_BANDS + 1] {
        let header = messages::CubeHeader { n_bands: n_bands as u32, ..header };
        bench.send::<CubeTopic>(START, header, vec![u32::MAX; n_cells * (n_bands + 1)]);
    }
    bench.tick().expect("a tick");
    assert_eq!(bench.counter("cubes_unusable"), 2);
}

#[test]
fn excess_exposures_without_submap_are_released() {
    let folder = drive(&street::manifest());
    let mut bench = Bench::<Colorize>::new(&Settings::default(), &context(folder.path())).expect("starts");
    let (header, rows) = street::expose(0, START);
    for i in 0..100 {
        bench.send::<ImageTopic>(START + i, header, rows.clone());
    }
    bench.tick().expect("a tick");
    assert_eq!(bench.counter("exposures_released_early"), 4);
}

#[test]
fn invalid_pose_in_trajectory_stops_stage() {
    let folder = drive(&street::manifest());
    let mut bench = Bench::<Colorize>::new(&Settings::default(), &context(folder.path())).expect("starts");
    let mut rows = street::trajectory(START, START + SECOND);
    rows[3].odom_from_body.rotation = [0.0; 4];
    bench.send::<TrajectoryTopic>(START, NoHeader::default(), rows);
    let error = bench.tick().expect_err("invalid pose").to_string();
    assert!(error.contains("trajectory") && error.contains("rigid transform"), "{error}");
}
