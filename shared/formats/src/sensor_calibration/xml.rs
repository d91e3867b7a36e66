//! XML elements with errors that contain path and line.

use super::SensorCalibrationError;
use roxmltree::Node;
use std::str::FromStr;

type Result<T> = std::result::Result<T, SensorCalibrationError>;

/// An element of the document.
#[derive(Clone, Copy)]
pub struct Element<'a>(pub Node<'a, 'a>);

impl<'a> Element<'a> {
    /// An error about this element.
    pub fn fault(self, rule: impl Into<String>) -> SensorCalibrationError {
        let mut names: Vec<&str> =
            self.0.ancestors().filter(Node::is_element).map(|node| node.tag_name().name()).collect();
        names.reverse();
        let line = self.0.document().text_pos_at(self.0.range().start).row;
        SensorCalibrationError { line, element: names.join("/"), rule: rule.into() }
    }

    /// The first child of one of these names.
    pub fn maybe(self, names: &[&str]) -> Option<Self> {
        names.iter().find_map(|name| self.children(name).next())
    }

    /// The first child of one of these names; an error if absent.
    pub fn child(self, names: &[&str]) -> Result<Self> {
        self.maybe(names).ok_or_else(|| self.fault(format!("expected a child {}", names.join(" or "))))
    }

    /// The element at the end of a path of children; an error if absent.
    pub fn descend(self, path: &[&str]) -> Result<Self> {
        path.iter().try_fold(self, |at, name| at.child(&[name]))
    }

    /// All children of a name.
    pub fn children(self, name: &str) -> impl Iterator<Item = Self> {
        self.0.children().filter(move |node| node.has_tag_name(name)).map(Self)
    }

    /// The trimmed text.
    pub fn text(self) -> &'a str {
        self.0.text().unwrap_or_default().trim()
    }

    /// The text of a child; empty if absent.
    pub fn text_of(self, name: &str) -> String {
        self.maybe(&[name]).map(Self::text).unwrap_or_default().to_owned()
    }

    /// The first attribute of one of these names; an error if absent.
    pub fn attribute(self, names: &[&str]) -> Result<&'a str> {
        let found = names.iter().find_map(|name| self.0.attribute(*name));
        found.ok_or_else(|| self.fault(format!("expected an attribute {}", names.join(" or "))))
    }

    /// The text as a number from `low` to `high`.
    pub fn number<T: Copy + FromStr + PartialOrd + std::fmt::Display>(self, low: T, high: T) -> Result<T> {
        let text = self.text();
        match text.parse() {
            Ok(value) if value >= low && value <= high => Ok(value),
            _ => Err(self.fault(format!("{text:?} is not a number from {low} to {high}"))),
        }
    }

    /// The numbers of a vector, separated by commas and blanks: in the attribute `values`, in the child `data` or in the text. The
    /// attribute `nr_elements` must agree if present.
    pub fn vector(self) -> Result<Vec<f64>> {
        let text = self.0.attribute("values").unwrap_or_else(|| self.maybe(&["data"]).unwrap_or(self).text());
        let parts = text.split(|c: char| c == ',' || c.is_whitespace()).filter(|part| !part.is_empty());
        let number = |(i, part): (usize, &str)| {
            let value = part.parse().ok().filter(|value: &f64| value.is_finite());
            value.ok_or_else(|| self.fault(format!("value {} of the vector, {part:?}, is not a finite number", i + 1)))
        };
        let values: Vec<f64> = parts.enumerate().map(number).collect::<Result<_>>()?;
        match self.0.attribute("nr_elements") {
            Some(promised) if promised.trim().parse() != Ok(values.len()) => {
                Err(self.fault(format!("nr_elements is {promised:?}, the vector has {} values", values.len())))
            }
            _ => Ok(values),
        }
    }
}
