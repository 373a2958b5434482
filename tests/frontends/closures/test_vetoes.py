"""Closures of the laser and of WiFi that are vetoed while the drive goes on."""

import numpy as np
import pytest
from circles import PRIOR, Circles, drive

from wayfi.frontends.closures.closure_config import ClosureConfig, ConsensusConfig
from wayfi.frontends.closures.lidar_closer import LidarCloser
from wayfi.frontends.closures.vetoes import VETOED, FormerClosures, VetoedClosure, VetoError, Vetoes
from wayfi.frontends.closures.wifi_closer import WifiCloser
from wayfi.frontends.events import ClosureJudged, Verdict
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.wifi.wifi_config import WifiConfig


def closed_by_laser(run: Circles) -> tuple[LidarCloser, Vetoes]:
    closer = LidarCloser(run.graph, run.keyframes, run.verdicts, ClosureConfig(), LidarConfig())
    closer.close_by_estimate(run.last, 0, run.poses())
    run.graph.update()
    assert list(closer.factors()) == [0]
    return closer, Vetoes(run.graph, run.verdicts, [closer])


def test_a_veto_takes_the_factor_out_and_a_restore_puts_it_back() -> None:
    run = drive(2.2, bias=0.01)
    before = run.poses()
    closer, vetoes = closed_by_laser(run)
    closed, factors = run.poses(), len(run.graph.factors())
    judged = vetoes.veto(0)
    run.graph.settle()
    assert (judged.verdict, judged.reason) == (Verdict.REMOVED, VETOED)
    assert len(run.graph.factors()) == factors - 1
    assert np.abs(run.poses() - before).max() < 0.01
    assert (set(vetoes.kept), closer.factors()) == ({0}, {})
    assert vetoes.kept[0].judged.verdict is Verdict.ACCEPTED
    restored = vetoes.restore(0)
    run.graph.settle()
    assert restored.verdict is Verdict.ACCEPTED
    assert np.abs(run.poses() - closed).max() < 0.01
    assert (vetoes.kept, list(closer.factors())) == ({}, [0])


def test_what_was_vetoed_is_not_closed_again_at_once() -> None:
    run = drive(2.2, bias=0.01)
    closer, vetoes = closed_by_laser(run)
    a = run.verdicts[0].keyframe_a
    vetoes.veto(0)
    run.graph.update()
    assert closer.close_by_wifi(run.candidate(a, run.last), 0, run.poses()).events == []
    assert closer.review(run.poses()) == []
    closer._last_check_m = -np.inf
    assert closer.close_by_estimate(run.last, 0, run.poses()) == []
    vetoes.restore(0)
    run.graph.update()
    assert list(closer.factors()) == [0]


def test_a_claim_of_wifi_that_was_vetoed_is_judged_no_more() -> None:
    run = drive(3.0, laser=False)
    closer = WifiCloser(
        run.graph,
        run.keyframes,
        run.verdicts,
        PRIOR,
        ConsensusConfig(min_posterior=0.0),
        WifiConfig(),
        lambda _: None,
        lambda _: None,
    )
    vetoes = Vetoes(run.graph, run.verdicts, [closer.claims])
    _, judged = closer.judge(run.candidate(run.last - run.per_round, run.last), 0, run.poses())
    assert isinstance(judged, ClosureJudged)
    assert judged.verdict is Verdict.ACCEPTED
    run.graph.update()
    vetoes.veto(0)
    run.graph.update()
    assert closer.review(run.poses(), last=True) == []
    assert closer.decide(0, run.poses(), last=True) == []
    assert vetoes.restore(0).verdict is Verdict.ACCEPTED
    assert list(closer.claims.factors()) == [0]


def test_what_cannot_be_edited_is_told() -> None:
    run = drive(2.2, bias=0.01)
    _, vetoes = closed_by_laser(run)
    with pytest.raises(VetoError, match="there is no closure 1: 1 were judged"):
        vetoes.veto(1)
    with pytest.raises(VetoError, match="closure 0 is not vetoed"):
        vetoes.restore(0)
    vetoes.veto(0)
    with pytest.raises(VetoError, match="closure 0 is vetoed already"):
        vetoes.veto(0)


def test_a_closure_whose_scans_were_forgotten_is_not_restored() -> None:
    run = drive(2.2, bias=0.01)
    closer, vetoes = closed_by_laser(run)
    vetoes.veto(0)
    factors = len(run.graph.factors())
    closer.withdraw("the mount was wrong")
    with pytest.raises(VetoError, match="the scans that it relates were forgotten"):
        vetoes.restore(0)
    assert len(run.graph.factors()) == factors


def test_what_a_map_has_vetoed_stays_so_until_it_is_restored() -> None:
    run = drive(2.2, bias=0.01)
    closer, vetoes = closed_by_laser(run)
    ((number,),) = closer.factors().values()
    factor = run.graph.factors()[number]
    run.graph.remove(number)
    former, judged = FormerClosures({}, 1), run.verdicts[0]
    closer.release(0)
    begun = Vetoes(run.graph, run.verdicts, [])
    begun.begin_with({0: VetoedClosure(judged, (factor,))}, former)
    assert run.verdicts[0].verdict is Verdict.REMOVED
    with pytest.raises(VetoError, match="vetoed already"):
        begun.veto(0)
    assert begun.restore(0).verdict is Verdict.ACCEPTED
    assert list(former.factors()) == [0]
    assert begun.veto(0).verdict is Verdict.REMOVED
    assert former.factors() == {}
    assert vetoes.kept == {}
