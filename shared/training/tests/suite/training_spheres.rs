//! Training spheres: balance of classes, and weights of items.

use random::Random;
use training::{DrawnItem, TrainingSpheres};

#[test]
fn epoch_has_spheres_of_all_classes_equally_often() {
    // A rare class and points without class.
    let classes: Vec<Option<u8>> = (0..10_000)
        .map(|i| {
            if i % 1000 == 7 {
                Some(3)
            } else if i % 5 == 0 {
                None
            } else {
                Some((i % 2) as u8)
            }
        })
        .collect();
    let mut spheres = TrainingSpheres::default();
    for (point, class) in classes.iter().enumerate() {
        if let Some(class) = class {
            spheres.add(*class, point as u32, 1.0);
        }
    }
    let mut random = Random::new(2);
    let mut epoch_of = |spheres: &TrainingSpheres| -> Vec<u32> {
        let drawn = (0..100).filter_map(|sphere| spheres.draw(sphere, &mut random));
        drawn
            .map(|DrawnItem { class, item: point }| {
                assert_eq!(classes[point as usize], Some(class));
                point
            })
            .collect()
    };
    let epoch = epoch_of(&spheres);
    let count = |class: Option<u8>| epoch.iter().filter(|point| classes[**point as usize] == class).count();
    assert_eq!(epoch.len(), 100);
    assert!([Some(0), Some(1), Some(3)].iter().all(|class| (33..=34).contains(&count(*class))));
    assert_eq!(count(None), 0);
    assert_ne!(epoch, epoch_of(&spheres));
    assert!(epoch_of(&TrainingSpheres::default()).is_empty());
}

#[test]
fn items_of_a_class_are_drawn_by_their_weights() {
    let mut spheres = TrainingSpheres::default();
    for (item, weight) in [(5, 1.0), (6, 3.0), (7, 0.0)] {
        spheres.add(2, item, weight);
    }
    let mut random = Random::new(1);
    let mut counts = [0; 3];
    for sphere in 0..4000 {
        let DrawnItem { class, item } = spheres.draw(sphere, &mut random).expect("an item");
        assert_eq!(class, 2);
        counts[item as usize - 5] += 1;
    }
    assert!((900..1100).contains(&counts[0]) && counts[2] == 0, "{counts:?}");
}
