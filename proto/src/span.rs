//! Ids of rows as spans: what an extent needs is one run of each body, or a few.

use crate::wire::Span;

/// Spans of ids that ascend.
pub fn spans_of(ids: &[u32]) -> Vec<Span> {
    let mut spans: Vec<Span> = Vec::new();
    for &id in ids {
        match spans.last_mut() {
            Some(span) if span.first.checked_add(span.count) == Some(id) => span.count += 1,
            _ => spans.push(Span {
                first: id,
                count: 1,
            }),
        }
    }
    spans
}

/// Number of ids in spans. They may have come from anywhere, so nothing is made of this many.
pub fn spanned(spans: &[Span]) -> u64 {
    spans.iter().map(|s| u64::from(s.count)).sum()
}

/// Whether an id is in one of the spans.
pub fn in_spans(spans: &[Span], id: u32) -> bool {
    let within = |s: &Span| id.checked_sub(s.first).is_some_and(|i| i < s.count);
    spans.iter().any(within)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_hold_what_they_are_made_of() {
        let ids = [0, 1, 2, 5, 9, 10, u32::MAX - 1];
        let spans = spans_of(&ids);
        assert_eq!((spans.len(), spanned(&spans)), (4, ids.len() as u64));
        assert!(ids.iter().all(|&id| in_spans(&spans, id)));
        assert!(
            [3, 4, 6, 8, 11, u32::MAX]
                .iter()
                .all(|&id| !in_spans(&spans, id))
        );
        assert!(spans_of(&[]).is_empty());
    }
}
