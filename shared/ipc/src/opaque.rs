//! A value of iceoryx2 whose drop code is compiled once, in this crate.
//!
//! Every program that drops a type compiles the drop code of its fields again; for iceoryx2 that takes many seconds.
//! Behind a trait object it is compiled only where the object is created, which is always here.

use std::ops::{Deref, DerefMut};

pub(crate) struct Opaque<V>(Box<dyn Holder<V>>);

impl<V: 'static> Opaque<V> {
    pub(crate) fn new(value: V) -> Self {
        Self(Box::new(Held(value)))
    }

    pub(crate) fn into_inner(self) -> V {
        self.0.into_value()
    }
}

impl<V> Deref for Opaque<V> {
    type Target = V;

    fn deref(&self) -> &V {
        self.0.value()
    }
}

impl<V> DerefMut for Opaque<V> {
    fn deref_mut(&mut self) -> &mut V {
        self.0.value_mut()
    }
}

/// A value as a trait object.
trait Holder<V> {
    fn value(&self) -> &V;
    fn value_mut(&mut self) -> &mut V;
    fn into_value(self: Box<Self>) -> V;
}

struct Held<V>(V);

impl<V> Holder<V> for Held<V> {
    fn value(&self) -> &V {
        &self.0
    }

    fn value_mut(&mut self) -> &mut V {
        &mut self.0
    }

    fn into_value(self: Box<Self>) -> V {
        self.0
    }
}
