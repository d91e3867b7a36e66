//! YAML as a tree, bounded by the length of its text: aliases are refused, and nesting is limited.

use saphyr_parser::{Event, Parser};

/// Largest depth of lists and maps.
const MAX_DEPTH: usize = 32;

/// A value and the line at which it starts.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Node {
    pub value: Value,
    pub line: usize,
}

/// A value. Tags are ignored.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Value {
    Scalar(String),
    List(Vec<Node>),
    Map(Vec<(String, Node)>),
}

/// An error in a text, with its line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("line {line}: {rule}")]
pub(crate) struct YamlError {
    pub line: usize,
    pub rule: String,
}

fn error(line: usize, rule: impl Into<String>) -> YamlError {
    YamlError { line, rule: rule.into() }
}

/// A list or map that is being filled.
enum Open {
    List(Vec<Node>, usize),
    /// The map, with the key whose value follows.
    Map(Vec<(String, Node)>, Option<String>, usize),
}

/// The documents of a text. The first line of OpenCV, `%YAML:1.0`, is skipped, and so is a byte order mark.
pub(crate) fn documents(text: &str) -> Result<Vec<Node>, YamlError> {
    let text = text.trim_start_matches('\u{feff}');
    // OpenCV's directive is not YAML; the line is kept so that line numbers are correct.
    let replaced = text.strip_prefix("%YAML:").map(|rest| format!("#YAML:{rest}"));
    let text = replaced.as_deref().unwrap_or(text);
    let mut open: Vec<Open> = Vec::new();
    let mut documents: Vec<Node> = Vec::new();
    for event in Parser::new_from_str(text) {
        let (event, span) = event.map_err(|found| error(found.marker().line(), found.info()))?;
        let line = span.start.line();
        let done = match event {
            Event::Alias(_) => return Err(error(line, "an alias (*name) is not supported; write the value out")),
            Event::SequenceStart(..) | Event::MappingStart(..) => {
                if open.len() >= MAX_DEPTH {
                    return Err(error(line, format!("more than {MAX_DEPTH} levels of lists and maps")));
                }
                open.push(match event {
                    Event::SequenceStart(..) => Open::List(Vec::new(), line),
                    _ => Open::Map(Vec::new(), None, line),
                });
                None
            }
            Event::Scalar(text, ..) => Some(Node { value: Value::Scalar(text.into_owned()), line }),
            Event::SequenceEnd | Event::MappingEnd => open.pop().map(Open::close),
            _ => None,
        };
        let Some(node) = done else { continue };
        match open.last_mut() {
            None => documents.push(node),
            Some(Open::List(list, _)) => list.push(node),
            Some(Open::Map(map, key, _)) => match key.take() {
                Some(key) => map.push((key, node)),
                None => match node.value {
                    Value::Scalar(text) => *key = Some(text),
                    _ => return Err(error(line, "a key must be a word")),
                },
            },
        }
    }
    Ok(documents)
}

impl Open {
    fn close(self) -> Node {
        match self {
            Self::List(list, line) => Node { value: Value::List(list), line },
            Self::Map(map, _, line) => Node { value: Value::Map(map), line },
        }
    }
}

impl Node {
    /// The value of a key, if this is a map that has it.
    pub fn get(&self, key: &str) -> Option<&Node> {
        match &self.value {
            Value::Map(map) => map.iter().find(|(name, _)| name == key).map(|(_, node)| node),
            _ => None,
        }
    }

    /// The value of the first of some keys.
    pub fn get_any(&self, keys: &[&str]) -> Option<&Node> {
        keys.iter().find_map(|key| self.get(key))
    }

    /// The value of a mandatory key.
    pub fn required(&self, key: &str) -> Result<&Node, YamlError> {
        self.get(key).ok_or_else(|| error(self.line, format!("no {key}")))
    }

    /// Keys and values; empty unless this is a map.
    pub fn entries(&self) -> &[(String, Node)] {
        match &self.value {
            Value::Map(map) => map,
            _ => &[],
        }
    }

    /// The elements; empty unless this is a list.
    pub fn elements(&self) -> &[Node] {
        match &self.value {
            Value::List(list) => list,
            _ => &[],
        }
    }

    /// The text of a scalar.
    pub fn text(&self) -> Option<&str> {
        match &self.value {
            Value::Scalar(text) => Some(text),
            _ => None,
        }
    }

    /// A finite number.
    pub fn number(&self) -> Result<f64, YamlError> {
        let found = self.text().and_then(|text| text.trim().parse::<f64>().ok()).filter(|value| value.is_finite());
        found.ok_or_else(|| {
            let text: String = self.text().unwrap_or("a list or map").chars().take(40).collect();
            error(self.line, format!("{text:?} is not a finite number"))
        })
    }

    /// All numbers of a list, or of a list of lists, in order; the numbers under `data` if this is an OpenCV matrix.
    pub fn numbers(&self) -> Result<Vec<f64>, YamlError> {
        if let Some(data) = self.get("data") {
            return data.numbers();
        }
        let Value::List(list) = &self.value else {
            return Err(error(self.line, "must be a list of numbers"));
        };
        let mut all = Vec::new();
        for node in list {
            match &node.value {
                Value::List(_) => all.extend(node.numbers()?),
                _ => all.push(node.number()?),
            }
        }
        Ok(all)
    }

    /// Exactly `N` numbers.
    pub fn numbers_of<const N: usize>(&self) -> Result<[f64; N], YamlError> {
        let numbers = self.numbers()?;
        let found = numbers.len();
        numbers.try_into().map_err(|_| error(self.line, format!("{found} numbers; must be {N}")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matrices_of_opencv_are_read() {
        let text = "%YAML:1.0\n---\nimage_width: 640\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 500., 0., 3.2e+02,\n       0., 501., 240., 0., 0., 1. ]\n";
        let documents = documents(text).expect("reads");
        let [document] = &documents[..] else { panic!("{documents:?}") };
        let matrix: [f64; 9] = document.required("camera_matrix").and_then(Node::numbers_of).expect("nine numbers");
        assert_eq!(matrix, [500.0, 0.0, 320.0, 0.0, 501.0, 240.0, 0.0, 0.0, 1.0]);
        assert_eq!(document.get("image_width").map(|node| (node.text(), node.line)), Some((Some("640"), 3)));
    }

    #[test]
    fn documents_are_separate() {
        let all = documents("a: 1\n---\na: [[1, 2], [3, .5]]\n---\n").expect("reads");
        assert_eq!(all[1].get("a").map(Node::numbers), Some(Ok(vec![1.0, 2.0, 3.0, 0.5])));
    }

    #[test]
    fn hostile_texts_are_refused() {
        let error = |text: &str| documents(text).expect_err("refused").to_string();
        assert!(error("a: &x [1]\nb: *x\n").starts_with("line 2: an alias"));
        assert!(error(&"[".repeat(100)).contains("levels"));
        assert!(error(&"- ".repeat(1000)).contains("levels"));
        assert!(documents(&"[".repeat(100_000)).is_err());
        assert!(error("a: [1, 2\n").starts_with("line "));
        let node = documents("a: [1, x]\n").expect("reads");
        let found = node[0].get("a").map(Node::numbers);
        assert_eq!(found, Some(Err(super::error(1, "\"x\" is not a finite number"))));
    }
}
