"""Holds the sentences of recordings that are wrong or were read in part, by reason code."""

from collections.abc import Mapping

from app.i18n.catalogues import N_

SENTENCES: Mapping[str, str] = {
    "at_byte": N_("{path}, byte {byte}"),
    "at_log_time": N_("{path}, log time {log_s:.3f} s"),
    "bag_folder_absent": N_("There is no such folder of recordings"),
    "bag_format_unknown": N_("it is no bag of format 2.0"),
    "bag_index_wrong": N_(
        "its index declares {declared_blocks} blocks with {declared} messages; it holds {blocks} with {found}"
    ),
    "bag_without_index": N_("The bag has no index: its recorder was cut off"),
    "blob_not_replayed": N_("The replay has not shown blob {digest} yet"),
    "block_checksum_wrong": N_("the checksum of a block is wrong"),
    "block_size_wrong": N_("a block does not unpack to its declared {size_bytes} bytes"),
    "block_too_large": N_("a block of {size_bytes} bytes exceeds the limit of {limit_bytes}"),
    "channel_undeclared": N_("a message belongs to channel {channel}, which the file does not declare"),
    "clouds_too_short": N_("clouds are shorter than their size says"),
    "clouds_without_axes": N_("clouds have no x, y and z of type float"),
    "copy_recording_again": N_("copy the recording again"),
    "cut_before_index": N_("The recording is truncated: it ends at byte {byte} without its closing index"),
    "cut_inside_record": N_("The recording is truncated: it ends at byte {byte} inside a record"),
    "database_structure_checked": N_("database structure verified; the format carries no checksums for its messages"),
    "every_block_checked": N_("checksum of every block verified"),
    "folder_count_wrong": N_("The folder's metadata declares {declared} messages; its files hold {found}"),
    "header_stamps_missing": N_("{count} messages on {topic} carry no header stamp"),
    "incident_bundle_unreadable": N_("The folder is no bundle of an incident ({error})"),
    "incident_folder_unusable": N_("The bundle's folder cannot be made ({error})"),
    "image_compression_unknown": N_("images are compressed as “{format}”"),
    "image_encoding_unknown": N_("images are encoded as “{encoding}”"),
    "images_damaged": N_("images are damaged"),
    "images_not_encodable": N_("images cannot be encoded"),
    "images_too_short": N_("images are shorter than their size says"),
    "index_checked": N_("structure and index compared; the format carries no checksums"),
    "message_count_wrong": N_("the file declares {declared} messages and holds {found}"),
    "message_too_short": N_("The message on {topic} at log time {log_s:.3f} s is too short to hold its header"),
    "message_undecodable": N_("A {type} on {topic} cannot be decoded ({error})"),
    "messages_encoding_unknown": N_("Its messages are encoded as {encodings}; readable are cdr and ros1"),
    "messages_thinned": N_("thinned to one message per {period_s:g} s"),
    "mission_too_large": N_(
        "The mission does not fit into {limit_bytes} bytes even without pictures and lidar ({size_bytes} bytes)"
    ),
    "mission_without_poses": N_("Mission {mission_id} has no poses to record"),
    "no_segment_left": N_("No recorded segment is left of {segments} at {at_s:.3f} s of mission time"),
    "not_a_recording": N_("This is not a recording: it begins with {start}"),
    "packed_recording_damaged": N_("The compressed recording is damaged ({error})"),
    "packing_unknown": N_("blocks are packed with “{packing}”; readable are zstd, lz4, bz2 and none"),
    "place_on_other_map": N_(
        "Place {place_id} lies on map {map_version} in frame {frame}; the recording is on {recorded_map_version} in "
        "frame {recorded_frame}"
    ),
    "position_topic_missing": N_(
        "Nothing in the recording says where the robot was: no body pose and no odometry topic"
    ),
    "position_topic_needed": N_("name a topic of type PoseStamped, PoseWithCovarianceStamped or Odometry"),
    "positions_change_frame": N_("Positions change their frame on the way: {frames}"),
    "positions_left_out": N_("{topic}: {count} positions are not finite"),
    "positions_not_finite": N_("None of the {count} positions on {topic} is finite"),
    "record_beyond_block": N_("a record reaches beyond its block"),
    "record_too_large": N_("a record of {size_bytes} bytes exceeds the limit of {limit_bytes}"),
    "recorded_point_in_other_frame": N_("A recorded {kind:word} is stated in {own}, positions in {frame}"),
    "recorded_point_not_finite": N_("A recorded {kind:word} is not finite"),
    "recorded_transform_invalid": N_("The recorded transform from {parent} to {child} is not one ({values})"),
    "recording_absent": N_("There is no such recording"),
    "recording_damaged": N_("The recording is damaged ({reason})"),
    "recording_empty": N_("The recording is empty: 0 bytes"),
    "recording_expands_too_far": N_("The recording expands beyond {limit_bytes} bytes"),
    "recording_files_missing": N_("The folder names {files} files and lacks {count}: {missing}"),
    "recording_incomplete": N_("{cut}; {count} messages before that are whole"),
    "recording_metadata_missing": N_("The folder has no metadata.yaml, so it is no rosbag2 recording"),
    "recording_metadata_unusable": N_("The folder's metadata cannot be used ({error})"),
    "recording_not_closed": N_("The database was not closed: {file} holds messages that are not in it yet"),
    "recording_storage_unknown": N_("The folder's storage is “{storage}”"),
    "recording_unreadable": N_("The recording cannot be read ({error})"),
    "recording_unwritable": N_("The recording cannot be written ({error})"),
    "recording_without_messages": N_("The recording holds no messages"),
    "replayed_blob_changed": N_("Blob {digest} changed on disk"),
    "role_ambiguous": N_("{role}: several topics, none read; name one of {topics}"),
    "role_topic_absent": N_("The {role} topic {topic} is not in the recording"),
    "role_topic_type": N_("The {role} topic {topic} has the type {type}"),
    "samples_left_out": N_("{topic}: {reason} ({count})"),
    "schema_undefined": N_("topic {topic} has schema {schema}, which is not defined"),
    "service_calls_only": N_("The recording holds service calls only, and no pose or odometry"),
    "structure_checked": N_("structure only: the file carries no checksums for its messages"),
    "summary_checksum_wrong": N_("the checksum of the summary section is wrong"),
    "topic_definition_missing": N_("Topic {topic} has the type {type}, whose definition is not in the file"),
    "topic_definition_unusable": N_("The definition of {type} on topic {topic} cannot be used ({error})"),
    "topic_encoding_unknown": N_("Topic {topic} is encoded as “{encoding}”; readable are cdr and ros1"),
    "topics_recorded": N_("recorded are {topics}"),
    "trajectory_ambiguous": N_("The folder has {times} and {count} trajectories beside it, not one"),
    "trajectory_goes_back": N_("The stamp of line {line} is earlier than the one before"),
    "trajectory_line_invalid": N_("Line {line} is none of a {format} file"),
    "trajectory_line_too_long": N_("Line {line} is longer than {limit_bytes} bytes"),
    "trajectory_times_short": N_("The file of times has fewer lines than the trajectory"),
    "trajectory_without_stamps": N_("The poses ({format}) carry no stamps"),
    "transform_missing": N_("no transform joins “{source}” to {frame} or to the body"),
    "whole_part_recoverable": N_(
        "{count} messages before that are whole: copy the file again, or replay them with --recover, which labels the "
        "mission incomplete"
    ),
}
REMEDIES: Mapping[str, str] = {
    "bag_folder_absent": N_("name a folder that holds recordings"),
    "blob_not_replayed": N_("ask for blobs that a sample names"),
    "folder_count_wrong": N_("copy the files again, or reindex the folder"),
    "incident_bundle_unreadable": N_("name a folder that `regen incident` wrote"),
    "incident_folder_unusable": N_("name another one with --out"),
    "message_too_short": N_("copy the recording again"),
    "message_undecodable": N_("record it again, or leave the topic out in the topic settings"),
    "messages_encoding_unknown": N_("convert the recording to ROS 2 CDR"),
    "mission_too_large": N_("raise the limit, or record fewer legs"),
    "mission_without_poses": N_("record a mission that moved"),
    "no_segment_left": N_("replay the recording from its start"),
    "not_a_recording": N_(
        "readable are .mcap, .mcap.zstd, a rosbag2 folder, .db3, ROS 1 .bag, trajectories (TUM, EuRoC CSV, KITTI) and "
        "CARMEN logs"
    ),
    "packed_recording_damaged": N_("copy it again from the robot"),
    "place_on_other_map": N_("give --target X,Y, or --topic map_version={map_version} if it was recorded on that map"),
    "positions_change_frame": N_("record one frame per topic"),
    "positions_not_finite": N_("name another position topic in the topic settings"),
    "recorded_point_in_other_frame": N_(
        "give the missing static transform in the topic settings, or the target with --target"
    ),
    "recorded_point_not_finite": N_("give the target with --target"),
    "recorded_transform_invalid": N_("give the transform in the topic settings and leave the recorded ones out"),
    "recording_absent": N_("check the path"),
    "recording_damaged": N_("copy it again from the robot and compare checksums"),
    "recording_empty": N_("copy the file again"),
    "recording_expands_too_far": N_("expand it by hand and replay the expanded file"),
    "recording_files_missing": N_("copy the missing files beside the others, or open one of the files by itself"),
    "recording_metadata_missing": N_("name one of its files, or reindex the folder"),
    "recording_metadata_unusable": N_("copy it again or reindex the folder"),
    "recording_not_closed": N_("open it once with sqlite3 where it was recorded, which merges them"),
    "recording_storage_unknown": N_("readable are .mcap, .mcap.zstd, a rosbag2 folder, .db3 and ROS 1 .bag"),
    "recording_unreadable": N_("check the file and its rights"),
    "recording_unwritable": N_("give a folder that exists and can be written, with space left"),
    "recording_without_messages": N_("record again; it declares {topics}"),
    "replayed_blob_changed": N_("start the replay again"),
    "role_topic_absent": N_("name one of type {types}; recorded are {topics}"),
    "role_topic_type": N_("name one of type {types}; recorded are {topics}"),
    "topic_definition_missing": N_(
        "record it with its definitions (MCAP does), or name another topic in the topic settings"
    ),
    "topic_definition_unusable": N_("record it again with complete definitions"),
    "topic_encoding_unknown": N_("convert the recording to ROS 2 CDR"),
    "trajectory_ambiguous": N_("put one trajectory and its times into a folder of their own"),
    "trajectory_goes_back": N_("sort the lines by their stamps"),
    "trajectory_line_invalid": N_("export it again"),
    "trajectory_line_too_long": N_("export it again"),
    "trajectory_times_short": N_("copy both files again"),
    "trajectory_without_stamps": N_(
        "give the time between two poses with --topic pose_period_s=SECONDS, or name a folder with the file and "
        "times.txt"
    ),
}
