//! Classes whose points are left out of the data, by their true labels: models for some of the classes (thesis table 6.8).

use anyhow::{Context, ensure};
use messages::{ClassId, GROUND_CLASSES};

/// Classes whose points are left out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RemovedClasses(Vec<ClassId>);

impl RemovedClasses {
    /// The classes of these names, which the model must not have.
    pub fn from_names(names: &[String], of_model: &[String]) -> anyhow::Result<Self> {
        let class = |name: &String| {
            ensure!(
                !of_model.contains(name),
                "{name} is in classes of [model]: a model cannot learn a class whose points are left out"
            );
            Ok(name.parse()?)
        };
        let classes = names.iter().map(class).collect::<anyhow::Result<_>>();
        classes.map(Self).context("[data] removed_classes")
    }
    fn has(&self, class: u8) -> bool {
        self.0.iter().any(|removed| *removed as u8 == class)
    }
    /// Whether the ground, or a part of it, is left out.
    pub fn has_ground(&self) -> bool {
        GROUND_CLASSES.iter().any(|class| self.0.contains(class))
    }
    /// Adds the points of the removed classes to the points that are left out for other reasons.
    pub fn with_points(&self, removed: Option<Vec<bool>>, classes: &[u8]) -> Option<Vec<bool>> {
        if self.0.is_empty() {
            return removed;
        }
        let mut removed = removed.unwrap_or_else(|| vec![false; classes.len()]);
        removed.iter_mut().zip(classes).for_each(|(removed, class)| *removed |= self.has(*class));
        Some(removed)
    }
    /// The rows of a column whose points are not left out.
    pub fn kept<T: Copy>(&self, column: &[T], classes: &[u8]) -> Vec<T> {
        let rows = column.iter().zip(classes);
        rows.filter(|(_, class)| !self.has(**class)).map(|(row, _)| *row).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_removed_classes_join_those_removed_before() {
        let names = ["road".to_owned(), "unlabeled".to_owned()];
        let removed = RemovedClasses::from_names(&names, &["pole".to_owned()]).expect("known names");
        let classes = [ClassId::Pole, ClassId::Road, ClassId::Unlabeled, ClassId::Wall].map(|class| class as u8);
        assert!(removed.has_ground());
        assert_eq!(removed.with_points(None, &classes), Some(vec![false, true, true, false]));
        let before = vec![false, false, false, true];
        assert_eq!(removed.with_points(Some(before.clone()), &classes), Some(vec![false, true, true, true]));
        assert_eq!(removed.kept(&[1, 2, 3, 4], &classes), [1, 4]);
        let none = RemovedClasses::default();
        assert_eq!((none.with_points(None, &classes), none.has_ground()), (None, false));
        assert_eq!(none.with_points(Some(before.clone()), &classes), Some(before));
    }
}
