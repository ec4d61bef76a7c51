"""One WebRTC connection that sends one track: from its offer to its end."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence

from aiortc import RTCConfiguration, RTCIceServer, RTCPeerConnection, RTCRtpSender, RTCSessionDescription
from aiortc.sdp import candidate_from_sdp

from fleet.errors import WireError
from fleet.video.signals import Candidate
from fleet.video.track import CameraTrack

CONNECTED_WITHIN = 30.0  # s from the offer, which the cloud keeps no longer
MOST_EARLY = 50  # candidates before the answer; anybody may send them
CODEC = "video/H264"  # alone: the media service would else choose one that not every browser has


class VideoPeer:
    """The connection; ``ended`` hears once why it is over, unless it was closed. On the loop only."""

    def __init__(
        self, track: CameraTrack, ice_servers: Sequence[RTCIceServer], ended: Callable[[str], None]
    ) -> None:
        self.track = track
        self._connection = RTCPeerConnection(RTCConfiguration(list(ice_servers)))
        self._ended = ended
        self._over = False
        self._answered = False
        self._early: list[Candidate] = []  # which came before the answer
        self._connection.on("connectionstatechange", self._changed)
        track.on("ended", lambda: self._end(track.failure or "the camera's pictures ended"))
        video = self._connection.addTransceiver(track, "sendonly")
        codecs = RTCRtpSender.getCapabilities("video").codecs
        video.setCodecPreferences([codec for codec in codecs if codec.mimeType == CODEC])
        self._deadline = asyncio.get_running_loop().call_later(CONNECTED_WITHIN, self._late)

    @property
    def connected(self) -> bool:
        """True while pictures reach the peer."""
        return self._connection.connectionState == "connected"

    @property
    def ice_state(self) -> str:
        """How far the way to the peer is found, in WebRTC's word."""
        return self._connection.iceConnectionState

    async def offer(self) -> str:
        """Return the SDP to offer, all of our own candidates in it."""
        await self._connection.setLocalDescription(await self._connection.createOffer())
        return self._connection.localDescription.sdp

    async def answered(self, sdp: str) -> None:
        """Take the answer; a second one is left alone. Raises WireError for one that cannot be used."""
        if self._connection.signalingState != "have-local-offer":
            return
        try:
            await self._connection.setRemoteDescription(RTCSessionDescription(sdp, "answer"))
        except Exception as error:  # noqa: BLE001 - aiortc raises whatever its parser stumbles over
            raise WireError(f"it cannot be used: {error!r}", where="answer") from None
        self._answered = True
        early, self._early = self._early, []
        for candidate in early:
            await self.add(candidate)

    async def add(self, candidate: Candidate) -> None:
        """Take a candidate of the peer; raises WireError for one that cannot be used."""
        if not self._answered:
            self._early = [*self._early[1 - MOST_EARLY :], candidate]
        elif candidate.candidate:
            try:
                found = candidate_from_sdp(candidate.candidate)
                found.sdpMid, found.sdpMLineIndex = candidate.mid, candidate.index
                await self._connection.addIceCandidate(found)
            except Exception as error:  # noqa: BLE001 - as above
                raise WireError(f"it cannot be used: {error!r}", where="candidate") from None

    async def close(self) -> None:
        """End it."""
        self._over = True
        self._deadline.cancel()
        self.track.stop()
        await self._connection.close()

    def _changed(self) -> None:
        """Take note of a new state."""
        state = self._connection.connectionState
        if state == "connected":
            self._deadline.cancel()
        elif state in ("failed", "closed"):
            self._end(f"the connection is {state}")

    def _late(self) -> None:
        """Give up an offer that nobody took, or to whom no way was found."""
        self._end(f"no peer was connected within {CONNECTED_WITHIN:g} s")

    def _end(self, why: str) -> None:
        """Tell once why it is over."""
        if not self._over:
            self._over = True
            self._ended(why)
