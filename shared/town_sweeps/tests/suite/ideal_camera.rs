//! Colors and reflectances of the points of simulated submaps.

use messages::ClassId;
use simulation::Town;
use town_sweeps::{IdealCamera, Mount, TownDrive};

#[test]
fn further_rays_reach_leaves_and_change_no_other_values() {
    let drive = TownDrive { town: Town::Urban, seed: 41, seconds: 2.0 };
    let simulation = drive.simulation().expect("makes a town");
    let submap = &drive.submaps_in(&simulation, 1, 1, 1, Mount::Rig).expect("long enough")[0];
    let shown: Vec<usize> = (0..submap.points.len()).collect();
    let values = |n_rays: u64| {
        let camera = IdealCamera::with_bands(&[650]).with_rays(n_rays);
        camera.values(&simulation, &submap.header, &submap.points, &shown)
    };
    let one = values(1);
    let many = values(32);
    let share = |values: &[f32], class: ClassId| {
        let of: Vec<bool> =
            values.iter().zip(&submap.truth).filter(|(_, c)| **c == class as u8).map(|(v, _)| !v.is_nan()).collect();
        assert!(of.len() > 500, "{} points of {}", of.len(), class.name());
        of.iter().filter(|is_known| **is_known).count() as f32 / of.len() as f32
    };
    let [before, after] = [&one, &many].map(|values| share(values, ClassId::Vegetation));
    assert!(before < 0.6 && after > 0.9, "{before} {after}");
    assert!(share(&many, ClassId::Building) > 0.98);
    assert_eq!(one.len(), many.len());
    assert!(one.iter().zip(&many).all(|(one, many)| one.is_nan() || one == many));
}

#[test]
fn vegetation_is_green_and_bright_in_infrared() {
    let drive = TownDrive { town: Town::Rural, seed: 9100, seconds: 2.0 };
    let simulation = drive.simulation().expect("makes a town");
    let submap = &drive.submaps_in(&simulation, 1, 2, 5, Mount::Rig).expect("long enough")[0];
    let shown: Vec<usize> = (0..submap.points.len()).step_by(7).collect();
    let values = |camera: &IdealCamera| camera.values(&simulation, &submap.header, &submap.points, &shown);
    let colors = values(&IdealCamera::color());
    let bands = values(&IdealCamera::with_bands(&[670, 800]));
    assert_eq!((colors.len(), bands.len()), (3 * shown.len(), 2 * shown.len()));
    let n_seen = colors.chunks_exact(3).filter(|color| !color[0].is_nan()).count();
    assert!(n_seen * 10 > shown.len() * 9, "{n_seen} of {} points", shown.len());
    let known = colors.iter().filter(|value| !value.is_nan());
    assert!(known.clone().all(|value| (0.0..=1.0).contains(value)));
    // Both cameras capture the same points of both sweeps.
    assert_eq!(colors.len() / 3, bands.len() / 2);
    assert!(colors.chunks_exact(3).zip(bands.chunks_exact(2)).all(|(a, b)| a[0].is_nan() == b[0].is_nan()));
    for sweep in 0..2 {
        let mean = |values: &[f32], n_bands: usize, band: usize, class: ClassId| {
            let of_class = |(place, point): (usize, &usize)| {
                let value = values[place * n_bands + band];
                let is_of = submap.truth[*point] == class as u8 && submap.points[*point].sweep_idx == sweep;
                (is_of && !value.is_nan()).then_some(value)
            };
            let of: Vec<f32> = shown.iter().enumerate().filter_map(of_class).collect();
            assert!(of.len() > 50, "{} points of {}", of.len(), class.name());
            of.iter().sum::<f32>() / of.len() as f32
        };
        let [red, green, blue] = [0, 1, 2].map(|band| mean(&colors, 3, band, ClassId::Vegetation));
        assert!(green > red && green > blue, "{red} {green} {blue}");
        let ratio = |class| mean(&bands, 2, 1, class) / mean(&bands, 2, 0, class);
        assert!(ratio(ClassId::Vegetation) > 3.0, "{}", ratio(ClassId::Vegetation));
        assert!(ratio(ClassId::Road) < 1.5, "{}", ratio(ClassId::Road));
    }
}
