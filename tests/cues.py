"""Figures of a placement that is right and clear."""

from mapmerge.match.cues import Contest, Cues, Fit

FIT = Fit(
    score_m=60.0,
    contradicted_m=1.4,
    wall_agreement=0.95,
    matched_wall_m=45.0,
    slack_agreement=0.97,
    far_share=0.01,
    slack_far_share=0.005,
    solidity=3.2,
    acceptance=0.98,
    overlap_m2=40.0,
    overlap_fraction=0.6,
    aligned=0.95,
    held_m=15.0,
)
CONTEST = Contest(log_odds=6.0, lead_log_odds=12.0, share=0.99, likeness=0.2, lead_m=48.0, crowd=1.0, clearance=3.0)
CUES = Cues(FIT, CONTEST)
