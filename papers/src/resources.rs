//! What circuits are made of.

/// Some equal parts of a circuit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Resource {
    /// What they are.
    pub what: &'static str,
    /// How many.
    pub count: u32,
    /// How wide each is.
    pub bits: u32,
    stores: bool,
    adds: bool,
}

impl Resource {
    const fn new(what: &'static str, (count, bits): (u32, u32), stores: bool, adds: bool) -> Self {
        Self {
            what,
            count,
            bits,
            stores,
            adds,
        }
    }

    /// Stores, and does nothing else.
    pub const fn register(what: &'static str, count: u32, bits: u32) -> Self {
        Self::new(what, (count, bits), true, false)
    }

    /// Adds.
    pub const fn adder(what: &'static str, count: u32, bits: u32) -> Self {
        Self::new(what, (count, bits), false, true)
    }

    /// Adds to what it stores.
    pub const fn accumulator(what: &'static str, count: u32, bits: u32) -> Self {
        Self::new(what, (count, bits), true, true)
    }

    /// Neither stores nor adds.
    pub const fn other(what: &'static str, count: u32, bits: u32) -> Self {
        Self::new(what, (count, bits), false, false)
    }
}

/// Bits that are stored: flip-flops.
pub fn flip_flops(list: &[Resource]) -> u32 {
    list.iter()
        .filter(|r| r.stores)
        .map(|r| r.count * r.bits)
        .sum()
}

/// Bits that are added at once: full adders.
pub fn full_adders(list: &[Resource]) -> u32 {
    list.iter()
        .filter(|r| r.adds)
        .map(|r| r.count * r.bits)
        .sum()
}

/// All of it in words.
pub fn in_words(list: &[Resource]) -> String {
    let each = list
        .iter()
        .map(|r| format!("{} × {} of {}", r.count, r.what, r.bits));
    each.collect::<Vec<_>>().join(", ")
}
