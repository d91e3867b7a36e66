//! Doubtful results are reported at the end of the run.

use crate::support::painted_street::{self as street, SECOND, START};
use crate::support::{drive, submap};
use colorize::{Colorize, Settings};
use messages::{CubeHeader, CubeTopic, ImageHeader, ImageTopic, NoHeader, SubmapTopic, TrajectoryTopic};
use stage::Context;
use stage::testing::{Bench, context};

const HOUR: i64 = 3600 * SECOND;
const DURATION_NANOS: u32 = 1_000_000_000;
const DOUBTS: [&str; 4] = ["few_points_colored", "images_unused", "no_spectra", "cubes_unused"];

/// Behavior of the cameras.
struct Cameras<'a> {
    /// The image as it arrives, with the error of its stamp, ns. `None`: the image is lost.
    image: &'a dyn Fn(ImageHeader) -> Option<(ImageHeader, i64)>,
    cube: &'a dyn Fn(CubeHeader) -> Option<(CubeHeader, i64)>,
    /// Whether the stage saves, restarts and loads after every tick.
    is_restarted: bool,
}

const GOOD: Cameras<'static> =
    Cameras { image: &|header| Some((header, 0)), cube: &|header| Some((header, 0)), is_restarted: false };

/// The doubts of a run of four seconds with one submap, in the order of [`DOUBTS`].
fn doubts_with(cameras: &Cameras<'_>, settings: &Settings, context: &Context) -> [Option<f64>; 4] {
    let mut bench = Bench::<Colorize>::new(settings, context).expect("starts");
    let points: Vec<_> = street::points(DURATION_NANOS).iter().map(|painted| painted.point).collect();
    for tick in 0..40 {
        let from = START - 3 * SECOND / 2 + tick * SECOND / 10;
        let until = from + SECOND / 10;
        bench.send::<TrajectoryTopic>(from, NoHeader::default(), street::trajectory(from, until));
        for burst in street::bursts().iter().filter(|burst| (from..until).contains(&burst.stamp)) {
            for (header, rows) in &burst.images {
                if let Some((header, error)) = (cameras.image)(*header) {
                    bench.send::<ImageTopic>(burst.stamp + error, header, rows.clone());
                }
            }
            for (header, rows) in &burst.cubes {
                if let Some((header, error)) = (cameras.cube)(*header) {
                    bench.send::<CubeTopic>(burst.stamp + error, header, rows.clone());
                }
            }
        }
        if until == START + i64::from(DURATION_NANOS) {
            bench.send::<SubmapTopic>(START, submap(street::odom_from_submap(), START, &points), points.clone());
        }
        bench.tick().expect("a tick");
        if cameras.is_restarted {
            bench = bench.restarted(settings, context).expect("loads its state");
        }
    }
    bench.finish().expect("an end");
    DOUBTS.map(|name| bench.doubt(name))
}

fn doubts(cameras: &Cameras<'_>) -> [Option<f64>; 4] {
    let folder = drive(&street::manifest());
    doubts_with(cameras, &Settings::default(), &context(folder.path()))
}

#[test]
fn good_cameras_give_no_doubt() {
    assert_eq!(doubts(&GOOD), [None; 4]);
}

#[test]
fn exposures_stamped_an_hour_off_are_doubted() {
    for error in [-HOUR, HOUR] {
        let image = |header| Some((header, error));
        let cube = |header| Some((header, error));
        for is_restarted in [false, true] {
            let found = doubts(&Cameras { image: &image, cube: &cube, is_restarted });
            assert_eq!(found, [Some(0.0), Some(1.0), Some(0.0), Some(1.0)], "{error} ns, restarted: {is_restarted}");
        }
    }
}

#[test]
fn one_camera_with_a_wrong_clock_is_doubted() {
    let image = |header: ImageHeader| Some((header, if header.camera == 1 { HOUR } else { 0 }));
    assert_eq!(doubts(&Cameras { image: &image, ..GOOD }), [None, Some(1.0), None, None]);
}

#[test]
fn images_that_do_not_match_the_rig_are_doubted() {
    let image = |header: ImageHeader| Some((ImageHeader { width: header.width / 2, ..header }, 0));
    assert_eq!(doubts(&Cameras { image: &image, ..GOOD }), [Some(0.0), Some(1.0), None, None]);
}

#[test]
fn cameras_without_any_exposure_are_doubted() {
    let none = Cameras { image: &|_| None, cube: &|_| None, is_restarted: false };
    assert_eq!(doubts(&none), [Some(0.0), None, Some(0.0), None]);
    // Without a publisher of a topic, no colors are expected from it.
    let folder = drive(&street::manifest());
    let mut context = context(folder.path());
    context.connected.retain(|topic| topic != "image" && topic != "cube");
    assert_eq!(doubts_with(&none, &Settings::default(), &context), [None; 4]);
    // Limits are settings.
    let settings = Settings { min_colored_share: 0.0, ..Settings::default() };
    let found = doubts_with(&none, &settings, &stage::testing::context(folder.path()));
    assert_eq!(found, [None, None, Some(0.0), None]);
}
