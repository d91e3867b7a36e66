//! A submap and its class column may come in different ticks: what came first waits.

use messages::{Class, Message, Submap};
use serde::{Deserialize, Serialize};
use stage::{Bytes, Inputs, Mode, Received, StepError};
use std::collections::VecDeque;

/// A submap and the classes of its points.
pub(crate) type Pair = (Received<Submap>, Received<Class>);

/// Messages that have no partner yet, in the order they came.
#[derive(Default)]
pub(crate) struct Pairing {
    /// Partners may never come.
    is_live: bool,
    submaps: VecDeque<Received<Submap>>,
    classes: VecDeque<Received<Class>>,
}

/// The same as bytes.
#[derive(Serialize, Deserialize)]
pub(crate) struct SavedPairing {
    submaps: Vec<Bytes>,
    classes: Vec<Bytes>,
}

impl Pairing {
    pub(crate) fn new(mode: Mode) -> Self {
        Self { is_live: mode == Mode::Live, ..Self::default() }
    }

    /// Takes the tick's messages.
    pub(crate) fn take(&mut self, inputs: &mut Inputs) {
        self.submaps.extend(inputs.take::<Submap>());
        self.classes.extend(inputs.take::<Class>());
    }

    /// Live: what is older than anything of the other kind that may still come has lost its partner; and no more is held than
    /// may be.
    fn let_go_of_the_lonely(&mut self) {
        let (submap, class) = (self.submaps.front().map(Received::seq), self.classes.front().map(Received::seq));
        if let (Some(submap), Some(class)) = (submap, class) {
            self.submaps.retain(|message| message.seq() >= class);
            self.classes.retain(|message| message.seq() >= submap);
        }
        let (n_submaps, n_classes) = (self.submaps.len(), self.classes.len());
        if self.classes.is_empty() {
            drop(self.submaps.drain(..n_submaps.saturating_sub(Submap::BORROWED)));
        }
        if self.submaps.is_empty() {
            drop(self.classes.drain(..n_classes.saturating_sub(Class::BORROWED)));
        }
    }

    /// The next submap whose classes are here. An error if the two are not of the same number and length.
    pub(crate) fn next(&mut self) -> Result<Option<Pair>, StepError> {
        if self.is_live {
            self.let_go_of_the_lonely();
        }
        if self.submaps.is_empty() || self.classes.is_empty() {
            return self.check_waiting().map(|()| None);
        }
        let (Some(submap), Some(classes)) = (self.submaps.pop_front(), self.classes.pop_front()) else {
            return Ok(None);
        };
        if submap.seq() != classes.seq() {
            let (got, expected) = (classes.seq(), submap.seq());
            return Err(StepError::data(format!("class column of submap {got} came when that of {expected} was due")));
        }
        let (n_points, n_rows) = (submap.rows().len(), classes.rows().len());
        if n_points != n_rows {
            let seq = submap.seq();
            return Err(StepError::data(format!(
                "class column of submap {seq} has {n_rows} rows for {n_points} points"
            )));
        }
        Ok(Some((submap, classes)))
    }

    /// At the end of the stream: a submap whose classes never came.
    pub(crate) fn next_without_class(&mut self) -> Option<Received<Submap>> {
        self.submaps.pop_front()
    }

    /// What waits stays in shared memory, where only so much may be held.
    fn check_waiting(&self) -> Result<(), StepError> {
        for (topic, waiting, limit) in
            [(Submap::TOPIC, self.submaps.len(), Submap::BORROWED), (Class::TOPIC, self.classes.len(), Class::BORROWED)]
        {
            if waiting > limit {
                let text = format!("{waiting} messages of {topic} wait for their partners, at most {limit} may");
                return Err(StepError::data(text));
            }
        }
        Ok(())
    }

    pub(crate) fn save(&self) -> SavedPairing {
        SavedPairing {
            submaps: self.submaps.iter().map(Received::to_bytes).collect(),
            classes: self.classes.iter().map(Received::to_bytes).collect(),
        }
    }

    pub(crate) fn load(&mut self, saved: &SavedPairing) -> Result<(), StepError> {
        self.submaps = saved.submaps.iter().map(|bytes| Received::from_bytes(bytes)).collect::<Result<_, _>>()?;
        self.classes = saved.classes.iter().map(|bytes| Received::from_bytes(bytes)).collect::<Result<_, _>>()?;
        Ok(())
    }
}
